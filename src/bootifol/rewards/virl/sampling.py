"""What is drawn at random for one gradient step, apart from the videos: which are compared, and how they are altered.

A positive copy has noise, or frames that changed places with their neighbors, or frames shown twice; a negative copy is
shuffled, cropped, or runs backward (paper, "Unsupervised data labelling"). All but the noise only reorder frames, so
their encodings are reordered too, not computed again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bootifol.errors import BootifolError
from bootifol.rewards.virl.config import VirlConfig

Indices = NDArray[np.int64]

FEWEST_FRAMES = 4
"""Shorter videos have no order that could be spoiled."""

CHANGED_FRAMES = 0.1
"""Fraction of the frames that a positive copy swaps or shows twice; the paper's main text gives none."""

ALTERED_FRACTION = 0.5
"""Chance that an anchor's positive and negative are altered copies of itself; otherwise the positive is another video
of its class, and the negative one of the other class. The paper's main text has both kinds and gives no fraction."""

FRAME_DROP = 0.05
"""Chance that a frame index is left out of a batch, the same indices in all its videos."""


@dataclass(frozen=True)
class Draw:
    """The random choices of one gradient step, for n expert videos followed by n of the agent (the pool)."""

    kept: Indices
    """`[T' + 1]` ascending: the frame indices that are looked at, the same for all videos. All other frame indices of
    this draw count within the kept frames."""

    noisy: Indices
    """`[k]`: videos of the pool of which a copy with noise is appended to the pool, as videos 2n … 2n + k - 1."""

    positive: tuple[Indices, Indices]
    """For each of the 2n anchors, the pool itself: a video `[2n]` of the longer pool, and its frames `[2n, T' + 1]`."""

    negative: tuple[Indices, Indices]
    """The same of its negative."""

    decoded: Indices
    """`[2n, F]`: the frames of each anchor that are reconstructed."""


def draw(config: VirlConfig, frames: int, rng: np.random.Generator) -> Draw:
    """Draws for videos of `frames` frames each.

    Raises:
        BootifolError: the videos are too short to be altered.
    """
    if frames < FEWEST_FRAMES:
        raise BootifolError(
            f"the videos have {frames} frames, but the reward model needs at least {FEWEST_FRAMES} to alter their "
            "order; use longer videos"
        )
    n = config.videos_per_class
    kept = _kept(frames, rng)
    length = len(kept)
    in_order = np.arange(length)
    altered = rng.random(2 * n) < ALTERED_FRACTION
    positives = np.concatenate([np.roll(np.arange(n), -1), n + np.roll(np.arange(n), -1)])
    negatives = np.roll(np.arange(2 * n), n)
    positive_frames = np.tile(in_order, (2 * n, 1))
    negative_frames = positive_frames.copy()
    noisy: list[int] = []
    for anchor in np.flatnonzero(altered):
        way = int(rng.integers(3))
        if way == 0:
            positives[anchor] = 2 * n + len(noisy)
            noisy.append(int(anchor))
        else:
            positives[anchor] = anchor
            positive_frames[anchor] = nearly_in_order(length, way == 1, rng)
        negatives[anchor] = anchor
        negative_frames[anchor] = out_of_order(length, rng)
    count = min(config.frames_per_video or length, length)
    decoded = np.sort(rng.random((2 * n, length)).argsort(axis=1)[:, :count], axis=1)
    return Draw(
        kept=kept,
        noisy=np.array(noisy, dtype=np.int64),
        positive=(positives, positive_frames),
        negative=(negatives, negative_frames),
        decoded=decoded,
    )


def nearly_in_order(length: int, swap: bool, rng: np.random.Generator) -> Indices:
    """`[length]`: some frames change places with the next one (`swap`), or are shown again in its place."""
    order = np.arange(length)
    count = max(1, round(CHANGED_FRAMES * length))
    for frame in rng.choice(length - 1, size=count, replace=False):
        following = order[frame + 1] if swap else order[frame]
        order[frame], order[frame + 1] = following, order[frame]
    return order


def out_of_order(length: int, rng: np.random.Generator) -> Indices:
    """`[length]`: shuffled; or cropped, so that it begins later and stands still at its end; or backward."""
    order = np.arange(length)
    way = int(rng.integers(3))
    if way == 0:
        return rng.permutation(order)
    if way == 1:
        start = int(rng.integers(1, length))
        return np.minimum(order + start, length - 1)
    return order[::-1].copy()


def _kept(frames: int, rng: np.random.Generator) -> Indices:
    """Cuts the end, frame i with `p(i) ~ frames - i` (the paper's early episode sequence priority), and drops single
    frames."""
    ends = np.arange(FEWEST_FRAMES, frames + 1)
    chances = (frames + 1 - ends).astype(np.float64)
    end = int(rng.choice(ends, p=chances / chances.sum()))
    kept = np.flatnonzero(rng.random(end) >= FRAME_DROP)
    return kept if len(kept) >= FEWEST_FRAMES else np.arange(end)
