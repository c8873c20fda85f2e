"""Random shift fused with the gather of stacked frames: one pass from the ring to a network's input.

The random shift is DrQ-v2's augmentation (Yarats et al., 2021, section 3.1): pad by replicating the border,
then crop at a random whole-pixel offset. Nothing is padded here; the border is replicated while reading.
"""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from numpy.typing import NDArray


def _crop_stacks(
    frames: NDArray[np.uint8],
    slots: NDArray[np.int64],
    shifts: NDArray[np.int64],
    out: NDArray[np.uint8],
) -> None:
    """Fills `out[b, y, x, 3 * i + c]` with `frames[slots[b, i], y + dy, x + dx, c]`, the border replicated.

    Args:
        frames: uint8 `[slots, S, S, 3]`.
        slots: int64 `[B, stack]`, where the frames of each stack are, oldest first.
        shifts: int64 `[B, 2]`, `(dy, dx)` in pixels.
        out: uint8 `[B, S, S, 3 * stack]`.
    """
    count, stack = slots.shape
    size = frames.shape[1]
    last = size - 1
    for b in range(count):
        dy = shifts[b, 0]
        dx = shifts[b, 1]
        for y in range(size):
            row = min(max(y + dy, 0), last)
            for i in range(stack):
                source = frames[slots[b, i], row]
                target = out[b, y]
                c = 3 * i
                for x in range(size):
                    column = min(max(x + dx, 0), last)
                    target[x, c] = source[column, 0]
                    target[x, c + 1] = source[column, 1]
                    target[x, c + 2] = source[column, 2]


crop_stacks: Callable[[NDArray[np.uint8], NDArray[np.int64], NDArray[np.int64], NDArray[np.uint8]], None] = (
    numba.njit(nogil=True)(_crop_stacks)
)
