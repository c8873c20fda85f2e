"""Refuses videos that a reward model was not made for."""

from __future__ import annotations

import numpy as np

from bootifol.errors import BootifolError
from bootifol.types import FrameBatch


def checked_videos(videos: FrameBatch, size: int) -> FrameBatch:
    """The same videos `[B, T + 1, H, W, 3]`.

    Raises:
        BootifolError: they are not uint8 RGB pictures of `size` pixels a side.
    """
    if videos.ndim != 5 or videos.dtype != np.uint8 or videos.shape[2:] != (size, size, 3):
        raise BootifolError(
            f"the reward model reads uint8 videos of {size}x{size} RGB frames, but was given {videos.dtype} "
            f"{list(videos.shape[1:])}; record or import the videos at that size"
        )
    return videos
