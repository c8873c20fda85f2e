"""From RGB pictures to the two views the frame encoders read: CIE Lab, normalized per channel.

sRGB primaries and transfer curve, white point D65 (IEC 61966-2-1; CIE 15). Lab is scaled by the range that
8-bit sRGB covers, so every channel lies in about [-1, 1]:
`L: (L - 50) / 50`, `a: (a - 6.025) / 92.208`, `b: (b + 6.69) / 101.17`.
"""

from __future__ import annotations

import numpy as np
import torch

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


def _linear_light() -> np.ndarray:
    """The sRGB curve undone for each of the 256 byte values, float64 `[256]`."""
    value = np.arange(256) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


# XYZ / white is a sum of one table row per channel: the curve, the matrix and the white point in one lookup.
_ROWS = _linear_light()[:, None, None] * (RGB_TO_XYZ / WHITE[:, None]).T[None]
_TABLE = torch.from_numpy(_ROWS.transpose(1, 0, 2).reshape(3 * 256, 3).astype(np.float32))

# Lab from f(X), f(Y), f(Z), with the normalization folded in.
_MIX = np.array([[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]]) / LAB_HALF_RANGE[:, None]
_SHIFT = (np.array([-16.0, 0.0, 0.0]) - LAB_CENTER) / LAB_HALF_RANGE

_DELTA = 6.0 / 29.0


def normalized_lab(rgb: torch.Tensor, dtype: torch.dtype = torch.float32) -> torch.Tensor:
    """RGB to normalized Lab.

    Args:
        rgb: uint8 `[..., 3]`.
        dtype: float32, or bfloat16 where the encoders compute in it.

    Returns:
        `dtype` `[..., 3]`: channel 0 is L (view 1), channels 1 and 2 are a and b (view 2), about [-1, 1].
    """
    table = _TABLE.to(rgb.device)
    index = rgb.to(torch.int32)
    x = table[index[..., 0]]
    x += table[index[..., 1] + 256]
    x += table[index[..., 2] + 512]
    curved = torch.where(x > _DELTA**3, x.pow(1.0 / 3.0), x / (3 * _DELTA**2) + 4.0 / 29.0)
    mix = torch.tensor(_MIX.T, dtype=torch.float32, device=rgb.device)
    shift = torch.tensor(_SHIFT, dtype=torch.float32, device=rgb.device)
    return (curved @ mix + shift).to(dtype)
