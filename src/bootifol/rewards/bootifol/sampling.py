"""What is drawn at random for one gradient step, apart from the videos: frames, triplets, the start of a prediction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bootifol.errors import BootifolError
from bootifol.rewards.bootifol.config import BootifolConfig

Indices = NDArray[np.int64]

EARLIEST_START = 5
"""L_Z predicts from a frame in EARLIEST_START ... T - K: earlier there is too little to predict from."""


@dataclass(frozen=True)
class Draw:
    """The random choices of one gradient step, for `B` videos."""

    kept: Indices
    """`[T' + 1]` ascending: the frame indices that were not dropped, the same for all videos. All other indices
    of this draw count within the kept frames."""

    anchors: Indices
    """`[B, F]`: the frames of each video on which L_S, L_triplet and L_ae are computed."""

    positives: Indices
    """`[B, F]`: for each anchor a frame within the window, not itself."""

    negatives: Indices
    """`[B, F]`: for each anchor a frame outside the window."""

    start: int
    """L_Z predicts the frames after this one."""


def draw(config: BootifolConfig, videos: int, frames: int, rng: np.random.Generator) -> Draw:
    """Draws for `videos` videos of `frames` frames each.

    Raises:
        BootifolError: the videos are too short for a negative outside the window or for K predictions.
    """
    fewest = max(2 * config.window + 2, config.predicted_states + 2)
    if frames < fewest:
        raise BootifolError(
            f"the videos have {frames} frames, but the reward model needs at least {fewest} "
            "(anchors with frames outside their window, and K frames to predict); use longer videos"
        )
    kept = np.flatnonzero(rng.random(frames) >= config.frame_drop)
    if len(kept) < fewest:
        kept = np.arange(frames)
    count = len(kept)
    per_video = min(config.frames_per_video or count, count)
    if per_video == count:
        anchors = np.tile(np.arange(count), (videos, 1))
    else:
        anchors = np.sort(rng.random((videos, count)).argpartition(per_video, axis=1)[:, :per_video], axis=1)
    latest = count - 1 - config.predicted_states
    return Draw(
        kept=kept,
        anchors=anchors,
        positives=_draw_among(anchors, _near(count, config.window), rng),
        negatives=_draw_among(anchors, ~_near(count, config.window) & ~np.eye(count, dtype=bool), rng),
        start=int(rng.integers(min(EARLIEST_START, latest), latest + 1)),
    )


def _near(count: int, window: int) -> NDArray[np.bool_]:
    """`[count, count]`: frames within the window of each frame, itself excepted."""
    distance = np.abs(np.arange(count)[:, None] - np.arange(count))
    near: NDArray[np.bool_] = (distance <= window) & (distance > 0)
    return near


def _draw_among(anchors: Indices, allowed: NDArray[np.bool_], rng: np.random.Generator) -> Indices:
    """One of the allowed frames for each anchor, uniformly: `allowed[a, j]` says whether anchor a may take j."""
    order = np.argsort(~allowed, axis=1, kind="stable")
    choices = allowed.sum(1)[anchors]
    drawn: Indices = order[anchors, (rng.random(anchors.shape) * choices).astype(np.int64)]
    return drawn
