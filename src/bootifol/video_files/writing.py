"""Writes mp4 files that every browser plays."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.types import Frame, Frames

# People look at these videos: enlarge small pictures to at least this many pixels.
_SMALLEST_SHOWN = 256


def write_video(path: Path, frames: Frames, frames_per_second: float) -> None:
    """Writes an mp4 that every browser plays (H.264, yuv420p, index first), whole or not at all.

    Small pictures are enlarged by a whole factor with hard edges, so that each pixel stays a square; the
    factor also makes both sides even, as H.264 wants them.

    Args:
        path: the .mp4 file.
        frames: uint8 `[frames, H, W, 3]` RGB, at least one.
        frames_per_second: playing speed.

    Raises:
        BootifolError: there are no frames, or the disk is full.
    """
    if frames.ndim != 4 or frames.shape[-1] != 3 or frames.size == 0 or frames.dtype != np.uint8:
        raise BootifolError(f"{path}: a video needs uint8 frames [n, H, W, 3], not {list(frames.shape)}")
    rate = exact_rate(frames_per_second)
    height, width = frames.shape[1:3]
    factor = math.ceil(_SMALLEST_SHOWN / max(height, width))
    if factor % 2 and (height % 2 or width % 2):
        factor += 1
    with (
        written_aside(path) as aside,
        encoded_video(
            aside, (height * factor, width * factor), rate, "yuv420p", {"crf": "18", "preset": "fast"}
        ) as add,
    ):
        for frame in frames:
            add(np.ascontiguousarray(frame.repeat(factor, axis=0).repeat(factor, axis=1)))


def exact_rate(frames_per_second: float) -> Fraction:
    """Frames per second as the fraction that video files store: 29.97 is 2997/100.

    Raises:
        BootifolError: it is not positive, or beyond what video files can hold.
    """
    if not 0.001 <= frames_per_second <= 1000:
        raise BootifolError(f"frames per second must be between 0.001 and 1000, not {frames_per_second}")
    return Fraction(frames_per_second).limit_denominator(1001)


@contextmanager
def encoded_video(
    path: Path, size: tuple[int, int], rate: Fraction, pixel_format: str, options: dict[str, str]
) -> Iterator[Callable[[Frame], None]]:
    """An H.264 mp4 with its index first, written frame by frame; the caller writes aside.

    Args:
        path: the file, whatever its suffix.
        size: height and width in pixels.
        rate: frames per second.
        pixel_format: `yuv420p` plays everywhere and wants even sides; `yuv444p` keeps every pixel's color.
        options: of the encoder x264.

    Yields:
        A function that adds one frame, uint8 `[H, W, 3]`.
    """
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=rate, options=options)
        (stream.height, stream.width), stream.pix_fmt = size, pixel_format
        stream.thread_count = 1  # the same bytes on every machine

        def add(frame: Frame) -> None:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))

        yield add
        container.mux(stream.encode(None))
