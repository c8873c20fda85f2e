"""Which expert videos an episode is compared with."""

from __future__ import annotations

import numpy as np

from bootifol.rewards.base import RewardModel
from bootifol.types import Video, VideoSource


def draw_references(
    model: RewardModel, expert: VideoSource, rng: np.random.Generator, excluded: int | None = None
) -> list[Video]:
    """As many different expert videos as one call of `label` wants, or all where there are fewer.

    Args:
        model: says how many it wants.
        expert: D_e.
        rng: draws them.
        excluded: index of an expert video that is itself rewarded, and would be perfect beside itself; it is drawn
            only where it is the only one.
    """
    if excluded is None or len(expert) == 1:
        drawn = rng.choice(len(expert), size=min(model.reference_count, len(expert)), replace=False)
    else:
        drawn = rng.choice(len(expert) - 1, size=min(model.reference_count, len(expert) - 1), replace=False)
        drawn += drawn >= excluded
    return [expert[int(index)] for index in drawn]
