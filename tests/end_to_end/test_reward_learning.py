"""That the reward alone is learned: it prefers what the videos show, whoever they show. A task drawn with numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.record import record_demos
from bootifol.evaluation.ranking import area_under_curve, rank_videos
from bootifol.presets import DRAWN_PIXELS
from bootifol.rewards.bootifol.model import BootifolRewardModel

PICTURES = DRAWN_PIXELS.pictures


@pytest.mark.parametrize(("shown", "other"), [("expert", "random"), ("random", "expert")])
def test_the_learned_reward_prefers_what_the_videos_show(tmp_path: Path, shown: str, other: str) -> None:
    """Whoever the videos show: with the roles swapped, a reward that merely likes calm pictures must fail."""
    # The target is drawn anew for each video: one fixed place would be told apart without learning.
    record_demos("drawn_reach", tmp_path, episodes=120, behaviors=("expert", "random"), pictures=PICTURES)
    sources, unseen = {}, {}
    for kind in (shown, other):
        sources[kind], aside = DemoSet.open(tmp_path / kind).split(24)
        unseen[kind] = [aside[index] for index in range(len(aside))]
    model = BootifolRewardModel(DRAWN_PIXELS.reward.bootifol, PICTURES.video_size, seed=1)
    steps = model.align(sources[shown], sources[other])
    for _ in range(120):
        next(steps)
    rows = rank_videos(model, unseen, sources[shown], np.random.default_rng(0), agent_steps=0)
    rewards = {kind: np.array([row.reward for row in rows if row.kind == kind]) for kind in unseen}
    preferred = area_under_curve(rewards[shown], rewards[other])
    print(f"AUC {shown} above {other}: {preferred:.2f}")
    assert preferred > 0.8
