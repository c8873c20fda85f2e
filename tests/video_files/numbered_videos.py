"""Small videos whose pictures carry their number, so that a lost, repeated or exchanged one is seen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from bootifol.demos.import_videos import _resampled
from bootifol.types import Frame, Frames
from bootifol.video_files.reading import stream_video

RATE = 10
NUMBERS = 16
"""Pictures are numbered modulo this."""

TWELVE = list(range(12))


def numbered(count: int = 12, height: int = 48, width: int = 64) -> Frames:
    """The number in 4 black or white bits above, most significant left; below blue at the left and red at the right."""
    frames = np.zeros((count, height, width, 3), np.uint8)
    for t in range(count):
        for bit in range(4):
            if t % NUMBERS >> (3 - bit) & 1:
                frames[t, : height // 2, bit * width // 4 : (bit + 1) * width // 4] = 255
    frames[:, height // 2 :, : width // 2] = (0, 0, 200)
    frames[:, height // 2 :, width // 2 :] = (200, 0, 0)
    return frames


def number(frame: Frame) -> int:
    """What `numbered` wrote."""
    height, width = frame.shape[:2]
    bits = [frame[height // 4, bit * width // 4 + width // 8].mean() > 127 for bit in range(4)]
    return sum(int(bit) << (3 - place) for place, bit in enumerate(bits))


def numbers(path: Path, frames_per_second: float | None = None) -> list[int]:
    """The numbers of the pictures of a file, as it is or at a frame rate."""
    if frames_per_second is None:
        return [number(timed.frame) for timed in stream_video(path)]
    return [number(frame) for frame in _resampled(path, frames_per_second)]


def encode(
    path: Path,
    frames: Frames | None = None,
    codec: str = "libx264",
    pixel_format: str = "yuv420p",
    rate: Fraction | int = RATE,
    stamps: tuple[Fraction, Sequence[int]] | None = None,
    options: dict[str, str] | None = None,
    container_options: dict[str, str] | None = None,
    container_format: str | None = None,
) -> Path:
    """Writes a video file.

    Args:
        frames: uint8 `[n, H, W, 3 or 4]`; twelve numbered ones by default.
        stamps: seconds of a tick, and when each picture appears, in ticks; 0, 1, 2 … of the rate by default.
    """
    frames = numbered() if frames is None else frames
    tick, times = stamps or (1 / Fraction(rate), range(len(frames)))
    with av.open(str(path), "w", format=container_format, options=container_options or {}) as container:
        stream: Any = container.add_stream(codec, rate=rate, options=options or {})
        stream.height, stream.width = frames.shape[1:3]
        stream.pix_fmt = pixel_format
        stream.codec_context.thread_count = 1
        stream.codec_context.time_base = tick
        for time, frame in zip(times, frames, strict=True):
            source = {3: "rgb24", 4: "rgba"}[frame.shape[-1]]
            picture = av.VideoFrame.from_ndarray(frame, format=source).reformat(format=pixel_format)
            picture.pts, picture.time_base = time, tick
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def copied(source: Path, target: Path, start: float | None = None, left_out: Iterable[int] = ()) -> Path:
    """Copies packets as they are, as `ffmpeg -c copy` does.

    Args:
        start: seconds to trim at, from the key frame before it on; what appears before it has times below 0.
        left_out: packets to drop, by their number.
    """
    with (
        av.open(str(source)) as read,
        av.open(str(target), "w", options={"avoid_negative_ts": "disabled"}) as written,
    ):
        stream = read.streams.video[0]
        copy = written.add_stream_from_template(stream)
        packets = [packet for packet in read.demux(stream) if packet.dts is not None]
        assert stream.time_base is not None
        shift = 0 if start is None else round(start / stream.time_base)
        first = max(
            place
            for place, packet in enumerate(packets)
            if packet.is_keyframe and packet.pts is not None and packet.pts <= max(shift, packets[0].pts or 0)
        )
        for place, packet in enumerate(packets):
            if place >= (0 if start is None else first) and place not in set(left_out):
                assert packet.pts is not None and packet.dts is not None
                packet.pts -= shift
                packet.dts -= shift
                packet.stream = copy
                written.mux(packet)
    return target
