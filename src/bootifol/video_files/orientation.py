"""A picture as people see it: upright, opaque, with square pixels, 8 bits a color."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import av
import numpy as np
from av.video.reformatter import Interpolation
from numpy.typing import NDArray
from PIL import Image, ImageOps

from bootifol.types import Frame
from bootifol.video_files.tone_mapping import is_hdr, tone_mapped

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

    lasts: float | None = None
    """Seconds until the picture disappears, where the file says so."""

    tick: float = 0.0
    """Seconds by which both may be off, since the file counts in steps that cannot hold its rate."""


def upright_frame(frame: av.VideoFrame, pixel_aspect: Fraction | None) -> Frame:
    """A decoded picture of a video as people see it, uint8 `[H, W, 3]` RGB.

    What is transparent is white. Pixels that are not square are stretched, never shrunk. Phones store portrait videos
    lying down, with a note how to turn them, and those of their front camera as in a mirror. High dynamic range (HLG
    and PQ) is tone-mapped.

    Args:
        frame: as decoded.
        pixel_aspect: width of a pixel divided by its height; None and nonsense count as 1.
    """
    if any(component.is_alpha for component in frame.format.components):
        pixels = over_white(np.asarray(_converted(frame, "rgba").to_ndarray(), np.uint8))
    elif is_hdr(frame):
        deep = np.asarray(_converted(frame, "rgb48le").to_ndarray(), np.uint16)
        pixels = tone_mapped(deep, frame.color_trc, frame.color_primaries)
    else:
        pixels = np.asarray(_converted(frame, "rgb24").to_ndarray(), np.uint8)
    if pixel_aspect and pixel_aspect != 1 and 1 / _MOST_STRETCHED <= pixel_aspect <= _MOST_STRETCHED:
        height, width = pixels.shape[:2]
        square = (round(width * max(1, pixel_aspect)), round(height * max(1, 1 / pixel_aspect)))
        pixels = np.asarray(Image.fromarray(pixels).resize(square, Image.Resampling.BILINEAR))
    return np.ascontiguousarray(_turned(pixels, _display_matrix(frame)))


def _display_matrix(frame: av.VideoFrame) -> tuple[int, int, int, int]:
    """How a stored pixel moves to where players show it: x' = a x + c y, y' = b x + d y, both axes from the top left.

    ISO 14496-12 writes `a, b, u, c, d, v, x, y, w` in fixed point; FFmpeg makes the same of other files' notes.
    """
    notes: Any = frame.side_data
    try:
        found = notes["DISPLAYMATRIX"]
    except KeyError:
        return 1, 0, 0, 1
    a, b, _, c, d, *_ = struct.unpack("=9i", bytes(found))
    return a, b, c, d


def _turned(pixels: Frame, matrix: tuple[int, int, int, int]) -> Frame:
    """The nearest of the eight ways to lay a picture: four turns, each of them mirrored or not."""
    a, b, c, d = matrix
    if abs(b) + abs(c) > abs(a) + abs(d):
        pixels, a, d = pixels.transpose(1, 0, 2), c, b
    return pixels[:: -1 if d < 0 else 1, :: -1 if a < 0 else 1]


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
