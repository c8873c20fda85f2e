"""What every reward model asks of the videos it is given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bootifol.errors import BootifolError
from bootifol.types import FrameBatch, Video


def checked_videos(videos: FrameBatch, video_size: int) -> FrameBatch:
    """The videos themselves, uint8 `[B, T + 1, video_size, video_size, 3]`.

    Raises:
        BootifolError: they have another type, shape or size.
    """
    if videos.ndim != 5 or videos.dtype != np.uint8 or videos.shape[2:] != (video_size, video_size, 3):
        raise BootifolError(
            f"the reward model reads uint8 videos of {video_size}x{video_size} RGB frames, but was given "
            f"{videos.dtype} {list(videos.shape[1:])}; record or import the videos at that size"
        )
    return videos


def check_references(video: Video, references: Sequence[Video], most: int) -> None:
    """Refuses references that `video` cannot be compared with.

    Raises:
        BootifolError: there is none, there are more than `most`, or one is shorter than the video.
    """
    if not 1 <= len(references) <= most:
        raise BootifolError(
            f"the reward model compares with 1 to {most} reference videos, but was given {len(references)}"
        )
    length = len(video.frames)
    for reference in references:
        if len(reference.frames) < length:
            raise BootifolError(
                f"the expert video {reference.name} has {len(reference.frames)} frames, fewer than the {length} of "
                f"{video.name}; record longer expert videos or use shorter episodes"
            )
