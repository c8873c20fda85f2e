"""What one video looks like at a glance: stillness, blank pictures, cuts, and a digest to compare it by."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bootifol.types import Frame, Frames

CELLS = 16
"""Pictures are looked at as 16×16 cells: compression noise averages out, a fingertip of two pixels does not."""

DIGEST_FRAMES = 8
"""Evenly spaced frames that stand for a video in a comparison."""

STILL_LEVELS = 2.0
"""A picture in which no cell differs by more (of 255) from an earlier one shows the same. Compressing a recorded video
moves cells by about 1."""

BLANK_RANGE = 12.0
"""A picture whose cells differ by less, in every channel, shows nothing. Recorded ones range over 88 or more."""

CUT_LEVELS = 16.0
"""A cell that changes by more from one frame to the next counts as changed."""

CUT_SHARE = 0.5
"""A cut changes more of the cells than this at once. In recorded videos at most 0.06 change."""

USUAL_SHARE = 0.1
"""But only where half of the frames change less than this: a camera on the move is no cut."""

CHANGED_LEVELS = 24
"""A pixel that changes by more in any channel from one frame to the next is counted: noise of a camera or of
compression is less."""

MOVING_SHARE = 0.1
"""Frames in which fewer pixels change than this fraction of the most that ever change at once stand still."""


@dataclass(frozen=True)
class VideoStatistics:
    """What was seen in one video."""

    first: Frame
    """Its first frame, uint8 `[H, W, 3]`."""

    digest: NDArray[np.uint8]
    """uint8 `[DIGEST_FRAMES, cells, cells, 3]`."""

    still_before_motion: float
    """The longest time that nothing moves and something moves later, as a fraction of the video."""

    still_at_end: float
    """The time after the last motion, as a fraction of the video; 1 when nothing ever moves."""

    moving_pixels: float
    """Fraction of the picture's pixels that change from one frame to the next while something moves, a median."""

    blank: int
    """Frames that are black, white or of any one color."""

    cut: int | None
    """The first frame of another scene, if there is one."""


def statistics_of(frames: Frames) -> VideoStatistics:
    """Looks at one video.

    Args:
        frames: uint8 `[n, H, W, 3]`, those that were seen, without padding.
    """
    cells = low_resolution(frames)
    blank = (np.ptp(cells, axis=(1, 2)) < BLANK_RANGE).all(-1)
    before, end = _still_fractions(cells)
    chosen = np.linspace(0, len(frames) - 1, DIGEST_FRAMES).round().astype(int)
    return VideoStatistics(
        first=frames[0].copy(),  # a view would keep the whole video in memory
        digest=cells[chosen].round().astype(np.uint8),
        still_before_motion=before,
        still_at_end=end,
        moving_pixels=_moving_pixels(frames),
        blank=int(blank.sum()),
        cut=_cut(cells, blank),
    )


def low_resolution(frames: Frames) -> NDArray[np.float32]:
    """Mean colors of up to 16×16 equal cells, float32 `[n, cells, cells, 3]` of 255; a rest at the edge is left out."""
    count, height, width, _ = frames.shape
    rows, columns = min(CELLS, height), min(CELLS, width)
    high, wide = height // rows, width // columns
    inside = frames[:, : rows * high, : columns * wide]
    means: NDArray[np.float32] = inside.reshape(count, rows, high, columns, wide, 3).mean(
        (2, 4), dtype=np.float32
    )
    return means


def _still_fractions(cells: NDArray[np.float32]) -> tuple[float, float]:
    """Longest stillness before a motion, and stillness at the end.

    A stillness is compared with the frame it begins with, so that slow motions add up and end it.
    """
    longest = start = 0
    for t in range(1, len(cells)):
        if np.abs(cells[t] - cells[start]).max() > STILL_LEVELS:
            longest = max(longest, t - start)
            start = t
    return longest / len(cells), (len(cells) - start) / len(cells)


def _moving_pixels(frames: Frames) -> float:
    if len(frames) < 2:
        return 0.0
    changed = np.array(
        [
            # Differences of uint8 would wrap around.
            (np.maximum(before, after) - np.minimum(before, after) > CHANGED_LEVELS).any(-1).mean()
            for before, after in pairwise(frames)
        ]
    )
    return float(np.median(changed[changed >= MOVING_SHARE * changed.max()]))


def _cut(cells: NDArray[np.float32], blank: NDArray[np.bool_]) -> int | None:
    """A fade from black or a flash is no cut: blank pictures are reported as such."""
    if len(cells) < 3:
        return None
    changed = (np.abs(np.diff(cells, axis=0)).max(-1) > CUT_LEVELS).mean((1, 2))
    if np.median(changed) > USUAL_SHARE:
        return None
    changed[blank[1:] | blank[:-1]] = 0.0
    most = int(changed.argmax())
    return most + 1 if changed[most] > CUT_SHARE else None
