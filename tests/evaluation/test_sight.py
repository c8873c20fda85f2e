"""Figures of sight, of performances that are made up and of performers on a drawn task."""

from __future__ import annotations

import numpy as np
import pytest

from bootifol.envs.pictures import PictureConfig
from bootifol.evaluation.sight import Performance, in_words, perform, sight
from bootifol.experts.failures import KINDS, failures_of
from bootifol.tasks import make_environment
from bootifol.types import Rewards, Video

PICTURES = PictureConfig(agent_size=32, video_size=32)


def made_up(performer: str, true: list[float], learned: list[float]) -> Performance:
    return Performance(performer, np.array(true, np.float32), np.array(learned, np.float32))


def test_an_expert_is_compared_with_episodes_that_failed() -> None:
    performances = [
        made_up("expert", [1, 1], [3, 3]),
        made_up("expert", [0, 1], [1, 2]),
        made_up("weak", [1, 1], [9, 9]),  # reached the target: no failure
        made_up("weak", [0, 0], [2, 2]),
        made_up("still", [0, 0], [0, 0]),
        made_up("still", [0, 0], [0, 0]),
    ]
    figures = sight(performances)
    # 6 and 3 against 4: one of two pairs.
    assert figures["auc:weak"] == 0.5
    assert figures["auc:still"] == 1.0
    # Steps with reward: 3, 3, 2, 9, 9; without: 1, 2, 2, 0, 0, 0, 0; ties with the two 2s count half.
    assert figures["step_auc"] == pytest.approx((7 * 4 + 5 + 2 * 0.5) / 35)
    assert "50% of pairs at worst (weak)" in in_words(figures)
    assert "does not see" in in_words(figures)
    assert "reward sees" in in_words({**figures, "auc:weak": 0.9})


def test_a_blind_reward_is_found_out_by_who_plays_smoothly() -> None:
    """The true reward passes; one that sees only that the dot comes to rest does not."""
    environment = make_environment("drawn_reach", PICTURES, 30)

    def at_rest(video: Video) -> Rewards:
        still = np.abs(np.diff(video.frames.astype(np.int16), axis=0)).mean(axis=(1, 2, 3))
        return (still < 0.05).astype(np.float32)

    blind = sight(list(perform("drawn_reach", environment, at_rest, episodes=6)))
    assert blind["auc:wrong_place"] < 0.75 and blind["auc:still"] == 0.0


def test_every_task_with_an_expert_has_failures() -> None:
    environment = make_environment("drawn_home", PICTURES, 30)
    kinds = failures_of("drawn_home", environment)
    assert kinds == [kind for kind in KINDS if kind not in ("half_trained", "near_miss")]
