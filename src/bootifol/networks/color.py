"""From RGB pictures to the two views the frame encoders read: CIE Lab, normalized per channel.

sRGB primaries and transfer curve, white point D65 (IEC 61966-2-1; CIE 15). Lab is scaled by the range that
8-bit sRGB covers, so every channel lies in about [-1, 1]:
`L: (L - 50) / 50`, `a: (a - 6.025) / 92.208`, `b: (b + 6.69) / 101.17`.

One compiled pass over the pixels, with a table for the sRGB curve and one, interpolated, for Lab's cube root: written
with tensor operations the same conversion took longer than the encoders of the `cpu` preset.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np
import torch
from numpy.typing import NDArray

RGB_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
"""Linear sRGB to CIE XYZ, D65."""

WHITE = RGB_TO_XYZ.sum(axis=1)
"""XYZ of RGB (1, 1, 1): white has a = b = 0 exactly."""

LAB_CENTER = np.array([50.0, 6.025, -6.69])
LAB_HALF_RANGE = np.array([50.0, 92.208, 101.17])

ROOT_STEPS = 4096
"""Intervals of the cube root's table; linear interpolation keeps normalized Lab within 1e-4."""

Floats = NDArray[np.float32]


def _linear_light() -> Floats:
    """The sRGB curve undone for each of the 256 byte values: `[256]` in [0, 1]."""
    value = np.arange(256) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _root_table() -> Floats:
    """Lab's f (a cube root, linear near 0) on a grid over [0, 1]: `[ROOT_STEPS + 1, 2]` values and differences.

    The last interval is there because 1 itself, and rounding a little above it, must find a value.
    """
    grid = np.arange(ROOT_STEPS + 2) / ROOT_STEPS
    delta = 6.0 / 29.0
    value = np.where(grid > delta**3, np.cbrt(grid), grid / (3 * delta**2) + 4.0 / 29.0)
    return np.stack([value[:-1], np.diff(value)], axis=1).astype(np.float32)


_LINEAR = _linear_light()
_ROOT = _root_table()
_TO_GRID = (ROOT_STEPS * RGB_TO_XYZ / WHITE[:, None]).astype(np.float32)
# L = 116 f(Y) - 16, a = 500 (f(X) - f(Y)), b = 200 (f(Y) - f(Z)), with the normalization folded in.
_FACTOR = (np.array([116.0, 500.0, 200.0]) / LAB_HALF_RANGE).astype(np.float32)
_OFFSET = ((np.array([-16.0, 0.0, 0.0]) - LAB_CENTER) / LAB_HALF_RANGE).astype(np.float32)


def _convert_pixels(
    rgb: NDArray[np.uint8],
    linear: Floats,
    to_grid: Floats,
    root: Floats,
    factor: Floats,
    offset: Floats,
    lightness: Floats,
    color: Floats,
) -> None:
    """Fills `lightness[i]` and `color[i]`, normalized L and ab, `[pixels]` and `[pixels, 2]`, from `rgb[i]`."""
    for i in range(rgb.shape[0]):
        r = linear[rgb[i, 0]]
        g = linear[rgb[i, 1]]
        b = linear[rgb[i, 2]]
        x = to_grid[0, 0] * r + to_grid[0, 1] * g + to_grid[0, 2] * b
        y = to_grid[1, 0] * r + to_grid[1, 1] * g + to_grid[1, 2] * b
        z = to_grid[2, 0] * r + to_grid[2, 1] * g + to_grid[2, 2] * b
        cell = np.int32(x)
        f_x = root[cell, 0] + (x - np.float32(cell)) * root[cell, 1]
        cell = np.int32(y)
        f_y = root[cell, 0] + (y - np.float32(cell)) * root[cell, 1]
        cell = np.int32(z)
        f_z = root[cell, 0] + (z - np.float32(cell)) * root[cell, 1]
        lightness[i] = factor[0] * f_y + offset[0]
        color[i, 0] = factor[1] * (f_x - f_y) + offset[1]
        color[i, 1] = factor[2] * (f_y - f_z) + offset[2]


_compiled: Callable[..., None] = numba.njit(nogil=True, fastmath=True)(_convert_pixels)


def lab_views(
    rgb: NDArray[np.uint8], dtype: torch.dtype = torch.float32
) -> tuple[torch.Tensor, torch.Tensor]:
    """RGB to the two views, about 10 ns a pixel on one thread; uses as many threads as PyTorch does.

    Args:
        rgb: uint8 `[N, H, W, 3]`.
        dtype: float32, or bfloat16 where the encoders compute in it.

    Returns:
        Normalized L `[N, 1, H, W]` (view 1) and ab `[N, 2, H, W]` (view 2), both `dtype`, channels last in memory,
        about [-1, 1].
    """
    count, height, width, _ = rgb.shape
    lightness = np.empty((count, height, width, 1), np.float32)
    color = np.empty((count, height, width, 2), np.float32)
    pixels = np.ascontiguousarray(rgb).reshape(-1, 3)
    parts = torch.get_num_threads()
    cuts = [len(pixels) * part // parts for part in range(parts + 1)]

    def convert(start: int, stop: int) -> None:
        _compiled(
            pixels[start:stop],
            *(_LINEAR, _TO_GRID, _ROOT, _FACTOR, _OFFSET),
            lightness.reshape(-1)[start:stop],
            color.reshape(-1, 2)[start:stop],
        )

    if parts == 1:
        convert(0, len(pixels))
    else:
        with ThreadPoolExecutor(parts) as threads:
            list(threads.map(convert, cuts[:-1], cuts[1:]))
    views = (torch.from_numpy(view).to(dtype).permute(0, 3, 1, 2) for view in (lightness, color))
    return next(views), next(views)
