"""Which expert videos an episode is compared with."""

from __future__ import annotations

import numpy as np

from bootifol.rewards.base import RewardModel
from bootifol.types import Video, VideoSource


def draw_references(model: RewardModel, expert: VideoSource, rng: np.random.Generator) -> list[Video]:
    """As many different expert videos as one call of `label` wants, or all where there are fewer."""
    drawn = rng.choice(len(expert), size=min(model.reference_count, len(expert)), replace=False)
    return [expert[int(index)] for index in drawn]


def reference_rng(seed: int, agent_steps: int) -> np.random.Generator:
    """The generator that draws references for measurements, apart from the one that learning draws from."""
    return np.random.default_rng([seed, 2, agent_steps])
