"""High dynamic range as a common screen shows it: HLG and PQ to BT.709, 8 bits.

A diffuse white of 203 cd/m², which is 75 % of HLG and 58 % of PQ (ITU-R BT.2408), becomes white. What is brighter,
lamps and reflections, is white, too.
"""

from __future__ import annotations

from functools import cache

import av
import numpy as np
from numpy.typing import NDArray

from bootifol.types import Frame

PQ, HLG = 16, 18
"""Numbers of the transfer functions in ITU-T H.273."""

_WHITE = 203.0
"""Luminance of diffuse white in cd/m²."""

_BT709 = 1
"""Number of its primaries in ITU-T H.273."""

_LUMINANCE = np.array([0.2627, 0.6780, 0.0593], np.float32)
"""Fractions of red, green and blue of BT.2020."""

_BT2020_TO_BT709 = np.array(
    [[1.660491, -0.587641, -0.072850], [-0.124550, 1.132900, -0.008349], [-0.018151, -0.100579, 1.118730]],
    np.float32,
)
"""Linear light from the wide primaries to the common ones (ITU-R BT.2087)."""

_LEVELS = 65536

_SIGNAL_OF_ONE = 255 * 256
"""What FFmpeg makes of the brightest level of 10 bits or more in 16."""


def is_hdr(frame: av.VideoFrame) -> bool:
    """Whether a decoded picture says that its levels are HLG or PQ."""
    return frame.color_trc in (PQ, HLG)


def tone_mapped(pixels: NDArray[np.uint16], transfer: int, primaries: int) -> Frame:
    """A picture of high dynamic range on a common screen.

    Args:
        pixels: uint16 `[H, W, 3]`, red, green and blue, of 65280 as FFmpeg makes them.
        transfer: `PQ` or `HLG`.
        primaries: as ITU-T H.273 numbers them; those of BT.709 stay, any others count as BT.2020's.

    Returns:
        uint8 `[H, W, 3]`.
    """
    light = _light(transfer)[pixels]
    if transfer == HLG:  # from the light of the scene to that of a screen of 1000 cd/m²
        luminance = light @ _LUMINANCE
        light = light * (1000 / _WHITE * luminance**0.2)[..., None]
    if primaries != _BT709:
        light = light @ _BT2020_TO_BT709.T
    return _shown()[(light.clip(0.0, 1.0) * (_LEVELS - 1) + 0.5).astype(np.uint16)]


@cache
def _light(transfer: int) -> NDArray[np.float32]:
    """Linear light of every level: for PQ 1 is diffuse white, for HLG the brightest of the scene."""
    signal = (np.arange(_LEVELS) / _SIGNAL_OF_ONE).clip(0, 1)
    if transfer == PQ:  # SMPTE ST 2084
        power = signal ** (1 / 78.84375)
        fraction = np.maximum(power - 0.8359375, 0) / (18.8515625 - 18.6875 * power)
        return (10_000 / _WHITE * fraction ** (1 / 0.1593017578125)).astype(np.float32)
    a, b, c = 0.17883277, 0.28466892, 0.55991073  # ARIB STD-B67
    return np.where(signal <= 0.5, signal**2 / 3, (np.exp((signal - c) / a) + b) / 12).astype(np.float32)


@cache
def _shown() -> NDArray[np.uint8]:
    """Levels of BT.709 for every amount of linear light."""
    light = np.arange(_LEVELS) / (_LEVELS - 1)
    curve = np.where(light < 0.018, 4.5 * light, 1.099 * light**0.45 - 0.099)
    return np.round(255 * curve).astype(np.uint8)
