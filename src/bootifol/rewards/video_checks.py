"""Videos that a reward model can read, and references it can compare with; others are refused with a sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bootifol.errors import BootifolError
from bootifol.types import FrameBatch, Video


def checked_videos(videos: FrameBatch, size: int) -> FrameBatch:
    """The videos as they are, if they are uint8 `[B, T + 1, size, size, 3]`.

    Raises:
        BootifolError: they are not.
    """
    if videos.ndim != 5 or videos.dtype != np.uint8 or videos.shape[2:] != (size, size, 3):
        raise BootifolError(
            f"the reward model reads uint8 videos of {size}x{size} RGB frames, but was given {videos.dtype} "
            f"{list(videos.shape[1:])}; record or import the videos at that size"
        )
    return videos


def check_references(video: Video, references: Sequence[Video], most: int) -> None:
    """Checks that a video can be compared with its references at every time step.

    Raises:
        BootifolError: there is none, there are more than `most`, or one is shorter than the video.
    """
    if not 1 <= len(references) <= most:
        raise BootifolError(
            f"the reward model compares with 1 to {most} reference videos, but was given {len(references)}"
        )
    for reference in references:
        if len(reference.frames) < len(video.frames):
            raise BootifolError(
                f"the expert video {reference.name} has {len(reference.frames)} frames, fewer than the "
                f"{len(video.frames)} of {video.name}; record longer expert videos or use shorter episodes"
            )
