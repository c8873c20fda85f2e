"""A picture as people see it: upright, opaque, with square pixels, 8 bits a color."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import av
import numpy as np
from av.video.reformatter import Interpolation
from numpy.typing import NDArray
from PIL import Image, ImageOps

from bootifol.types import Frame

# Pixels longer than this are a damaged header, not a format that anyone films in (the widest, anamorphic, is 2).
_MOST_STRETCHED = 4

_ROUNDED = Interpolation.BILINEAR | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INT
"""How FFmpeg converts colors: to the nearest level, each pixel's color for itself."""


@dataclass(frozen=True)
class TimedFrame:
    """One picture of a video and when it appears."""

    frame: Frame
    """uint8 `[H, W, 3]` RGB, upright."""

    seconds: float | None
    """After the first frame; None when the file does not know (folders of pictures, arrays)."""


def upright_frame(frame: av.VideoFrame, pixel_aspect: Fraction | None) -> Frame:
    """A decoded picture of a video as people see it, uint8 `[H, W, 3]` RGB.

    What is transparent is white. Pixels that are not square are stretched, never shrunk. Phones store portrait videos
    lying down, with a note how to turn them.

    Args:
        frame: as decoded.
        pixel_aspect: width of a pixel divided by its height; None and nonsense count as 1.
    """
    if any(component.is_alpha for component in frame.format.components):
        pixels = over_white(np.asarray(_converted(frame, "rgba").to_ndarray(), np.uint8))
    else:
        pixels = np.asarray(_converted(frame, "rgb24").to_ndarray(), np.uint8)
    if pixel_aspect and pixel_aspect != 1 and 1 / _MOST_STRETCHED <= pixel_aspect <= _MOST_STRETCHED:
        height, width = pixels.shape[:2]
        square = (round(width * max(1, pixel_aspect)), round(height * max(1, 1 / pixel_aspect)))
        pixels = np.asarray(Image.fromarray(pixels).resize(square, Image.Resampling.BILINEAR))
    return np.ascontiguousarray(np.rot90(pixels, k=round(frame.rotation / 90)))


def _converted(frame: av.VideoFrame, pixel_format: str) -> av.VideoFrame:
    """The frame in another pixel format, rounded to the nearest level.

    FFmpeg's quick way rounds down, which darkens every pixel by about half a level (green by a whole one): nothing to
    an eye, but a mark that every video file has and no picture of an environment, by which a reward would tell them
    apart.
    """
    return frame.reformat(format=pixel_format, interpolation=_ROUNDED)


def upright_picture(picture: Image.Image) -> Frame:
    """A still picture upright, transparent places white, 16 bits a pixel scaled to 8: uint8 `[H, W, 3]`."""
    upright = ImageOps.exif_transpose(picture)
    if upright.has_transparency_data:
        return over_white(np.asarray(upright.convert("RGBA")))
    if upright.mode.startswith("I"):  # otherwise all above 255 of 65535 would be white
        upright = Image.fromarray((np.asarray(upright) >> 8).clip(0, 255).astype(np.uint8))
    return np.asarray(upright.convert("RGB"))


def over_white(pixels: NDArray[np.uint8]) -> Frame:
    """A picture with alpha, uint8 `[H, W, 4]`, on a white ground as browsers show it: uint8 `[H, W, 3]`."""
    alpha = pixels[..., 3:].astype(np.uint16)
    blended: Frame = ((pixels[..., :3] * alpha + 255 * (255 - alpha) + 127) // 255).astype(np.uint8)
    return blended
