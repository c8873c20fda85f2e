"""The learned reward along videos, from a run's checkpoint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_runs import TINY, new_run

from bootifol.training.api import score_videos

SHORT = replace(TINY, interactive=replace(TINY.interactive, agent_steps=30))


@pytest.mark.parametrize("method", ["bootifol", "gaifo"])
def test_videos_are_scored_as_far_as_the_method_can_compare(tmp_path: Path, demos: Path, method: str) -> None:
    """Without reference videos, to the end."""
    assert new_run(tmp_path / "run", demos, method, SHORT).learn()
    size = SHORT.pictures.video_size
    np.save(tmp_path / "long.npy", np.random.default_rng(0).integers(0, 256, (90, size, size, 3), np.uint8))
    (rewards,) = score_videos(tmp_path / "run", [tmp_path / "long.npy"]).values()
    expert_steps = len(np.load(next((demos / "expert").glob("*.npy")), mmap_mode="r")[0]) - 1
    assert len(rewards) == (89 if method == "gaifo" else expert_steps)
    assert np.isfinite(rewards).all()
