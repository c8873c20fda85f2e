"""Expert videos corrupted in time: failures that move as smoothly as the expert and look just like it.

Beyond the paper. What tells an expert's video from a random one at first glance is how it moves, not what it
achieves, so the reward learns to like smooth motion. An expert that stops short of its goal, turns back or leaves it
moves just as smoothly: what is left to tell it apart is the task.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Scalar = TypeVar("Scalar", bound=np.generic)

LATEST_TURN = 0.2
"""A video stops or turns back within this part of its length, before most experts have arrived."""


def time_corrupted(videos: NDArray[Scalar], rng: np.random.Generator) -> NDArray[Scalar]:
    """Each video in one of three ways, drawn at random.

    - it stops early and stands still;
    - it turns back early, and stands still at its start;
    - it runs backward from a later moment to its start, and stands still.

    Args:
        videos: expert videos, pixels `[n, T + 1, H, W, 3]` or features `[n, T + 1, F]`.
        rng: draws the way and the moment.

    Returns:
        The same shape; frames are those of the video itself, in another order.
    """
    count, frames = videos.shape[:2]
    ways = rng.integers(3, size=(count,))
    turns = 1 + rng.integers(max(int(LATEST_TURN * (frames - 1)), 1), size=(count,))
    order = np.stack([_order(int(ways[i]), int(turns[i]), frames) for i in range(count)])
    result: NDArray[Scalar] = videos[np.arange(count)[:, None], order]
    return result


def _order(way: int, turn: int, frames: int) -> NDArray[np.int64]:
    """Indices `[frames]` of the frames to show."""
    time = np.arange(frames)
    if way == 0:
        return np.minimum(time, turn)
    if way == 1:
        return np.maximum(np.minimum(time, 2 * turn - time), 0)
    return np.maximum(min(2 * turn, frames - 1) - time, 0)
