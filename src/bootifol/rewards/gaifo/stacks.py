"""Stacks of successive frames, as the discriminator reads them.

frames   0 1 2 3 4         a stack of 3 ends at every frame but the first;
stacks   0 0 1             the first frame stands in for those before it
         0 1 2
           1 2 3
             2 3 4
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from bootifol.types import FrameBatch

Indices = NDArray[np.int64]


def stack_frames(last: Indices, stack: int) -> Indices:
    """The frame indices `[..., stack]`, oldest first, of the stacks that end at the frames `last`."""
    indices: Indices = np.maximum(last[..., None] + np.arange(1 - stack, 1), 0)
    return indices


def draw_stacks(videos: FrameBatch, per_video: int, stack: int, rng: np.random.Generator) -> FrameBatch:
    """Stacks at random moments of each video: uint8 `[B, T + 1, H, W, 3]` to `[B * per_video, stack, H, W, 3]`."""
    count, frames = videos.shape[:2]
    last = rng.integers(1, frames, size=(count, per_video))
    drawn: FrameBatch = videos[np.arange(count)[:, None, None], stack_frames(last, stack)]
    return drawn.reshape(-1, *drawn.shape[2:])


def as_pictures(stacks: FrameBatch) -> torch.Tensor:
    """uint8 `[N, stack, H, W, 3]` to float32 `[N, 3 * stack, H, W]` in [0, 1], channels last in memory."""
    count, depth, height, width, _ = stacks.shape
    pixels = np.ascontiguousarray(stacks.transpose(0, 2, 3, 1, 4)).reshape(count, height, width, 3 * depth)
    return torch.from_numpy(pixels).permute(0, 3, 1, 2).float() / 255
