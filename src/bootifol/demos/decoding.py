"""Decodes video files picture by picture, and notices where one ends too early.

Players forgive a truncated file; a data set must not. So what was decoded is compared with what the file promises:
pictures, seconds, bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import av

from bootifol.demos.upright import TimedFrame, upright_frame
from bootifol.errors import BootifolError


def stream_file(path: Path) -> Iterator[TimedFrame]:
    """Decodes a whole video file.

    Raises:
        BootifolError: the file is damaged, truncated or no video; at the latest at its end.
    """
    count = 0
    first = end = 0.0
    with _opened(path) as container:
        stream = container.streams.video[0]
        promised = _promised_frames(stream)
        try:
            for frame in container.decode(stream):
                if frame.is_corrupt:
                    raise _truncated(path, count, promised, "a picture is corrupt")
                seconds = frame.time if frame.time is not None else end
                if count == 0:
                    first = seconds
                lasts = frame.duration * frame.time_base if frame.duration and frame.time_base else 0
                end = seconds + float(lasts)
                count += 1
                yield TimedFrame(upright_frame(frame, stream.sample_aspect_ratio), seconds - first)
        except av.FFmpegError as error:
            raise _truncated(path, count, promised, str(error.strerror)) from error
        promised_seconds = _promised_seconds(container)
    if count == 0:
        raise BootifolError(f"{path} holds no pictures (damaged or truncated?): copy or export it again")
    if count < promised:
        raise _truncated(path, count, promised, "it ends too early")
    if path.stat().st_size < _promised_bytes(path):
        raise BootifolError(
            f"{path} is truncated: it has {path.stat().st_size:,} of {_promised_bytes(path):,} bytes; copy or export "
            "it again"
        )
    # Where frames are not counted the length may still be known; the last frame's own duration may not be.
    if not promised and promised_seconds is not None and end + 1.5 * end / count < promised_seconds:
        raise BootifolError(
            f"{path} is truncated: its pictures end after {end:.2f} s of {promised_seconds:.2f} s; "
            "copy or export it again"
        )
    if path.suffix.lower() == ".gif" and not path.read_bytes().rstrip(b"\0").endswith(b";"):
        raise BootifolError(
            f"{path} is truncated: the mark at a gif's end is missing; copy or export it again"
        )


def stream_part(path: Path, start: float, end: float) -> Iterator[TimedFrame]:
    """Decodes the pictures of a video file that appear from `start` until before `end`, in seconds of its clock.

    The file is entered at the key frame before `start`, not at its beginning. How many pictures there ought to be
    is for the caller to check.

    Raises:
        BootifolError: the file is damaged before `end`.
    """
    first: float | None = None
    with _opened(path) as container:
        stream = container.streams.video[0]
        try:
            if start > 0 and stream.time_base:
                container.seek(int(start / stream.time_base), stream=stream)
            for frame in container.decode(stream):
                if frame.time is None or frame.time < start:
                    continue
                if frame.time >= end:
                    return
                if frame.is_corrupt:
                    raise BootifolError(
                        f"{path} is damaged: the picture at {frame.time:.2f} s is corrupt; copy or export it again"
                    )
                first = frame.time if first is None else first
                yield TimedFrame(upright_frame(frame, stream.sample_aspect_ratio), frame.time - first)
        except av.FFmpegError as error:
            raise BootifolError(
                f"{path} is damaged or truncated between {start:.2f} and {end:.2f} s ({error.strerror}): "
                "copy or export it again"
            ) from error


def declared_rate(path: Path) -> float | None:
    """Frames per second as a video file declares it; None where it does not."""
    with _opened(path) as container:
        rate = container.streams.video[0].average_rate
        return float(rate) if rate else None


@contextmanager
def _opened(path: Path) -> Iterator[av.container.InputContainer]:
    try:
        container = av.open(str(path))
    except (av.FFmpegError, ValueError) as error:
        raise BootifolError(
            f"{path} is damaged, truncated or no video ({error}): copy or export it again"
        ) from error
    with container:
        if not container.streams.video:
            raise BootifolError(f"{path} holds no pictures (truncated, or sound only): give a whole video")
        yield container


def _promised_frames(stream: av.VideoStream) -> int:
    """The number of frames the file says it has; 0 when it does not say."""
    counted = int(stream.frames)
    if not counted or stream.duration is None or not stream.average_rate or not stream.time_base:
        return counted
    # A video trimmed by an edit list still counts the frames before the cut, and plays shorter.
    played = float(stream.duration * stream.time_base * stream.average_rate)
    return counted if played > counted - 0.5 else math.floor(played) - 1


def _promised_seconds(container: av.container.InputContainer) -> float | None:
    """How long the pictures should last; None when the file does not say, or when sound may last longer."""
    if container.duration is None or len(container.streams) > 1:
        return None
    return float(container.duration / av.time_base)


def _promised_bytes(path: Path) -> int:
    """How long an avi, webm or mkv file says it is; 0 when it does not say. These play without their last bytes."""
    with path.open("rb") as file:
        head = file.read(4096)
    if head[:4] == b"RIFF":
        riff = int.from_bytes(head[4:8], "little")
        return 8 + riff if riff < 0xFFFFFFFF else 0
    if head[:4] != b"\x1aE\xdf\xa3":
        return 0
    # EBML: an element is its name, its size as a number whose leading zero bits tell its length, and its contents.
    header, header_bytes = _ebml_size(head, 4)
    segment = header + (header_bytes or 0)
    if head[segment : segment + 4] != b"\x18S\x80g":
        return 0
    start, size = _ebml_size(head, segment + 4)
    return start + size if size is not None else 0


def _ebml_size(head: bytes, place: int) -> tuple[int, int | None]:
    """Where an element's contents begin, and their size; None when it was not known (a live recording)."""
    length = 9 - head[place].bit_length() if place < len(head) else 9
    if length > 8:
        return place, None
    unmarked = int.from_bytes(head[place : place + length], "big") - (1 << 7 * length)
    return place + length, unmarked if unmarked != (1 << 7 * length) - 1 else None


def _truncated(path: Path, count: int, promised: int, why: str) -> BootifolError:
    of = f" of {promised}" if promised else ""
    return BootifolError(
        f"{path} is damaged or truncated: {count}{of} pictures could be read ({why}); copy or export it again"
    )
