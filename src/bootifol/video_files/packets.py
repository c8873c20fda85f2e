"""What a video file holds, by its packets alone: nothing is decoded.

Players forgive a file that ends early; a data set must not. So what is there is compared with what the file promises:
pictures, seconds, bytes, marks at its end. And packets tell when pictures appear, also where pictures do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from bootifol.errors import BootifolError, warn
from bootifol.video_files.file_ends import fragments_end, lacks_its_end, promised_bytes
from bootifol.video_files.kinds import RAW_STREAMS

_LARGEST_NOTHING = 19
"""Bytes of an MPEG-4 packet that only says "as before", for which no picture is decoded."""


@dataclass(frozen=True)
class Packets:
    """The packets of one track, as far as they show pictures."""

    stamps: tuple[int, ...]
    """When the pictures appear, ascending, in ticks; empty where the file does not say."""

    tick: Fraction
    """Seconds."""

    reordered: bool
    """Whether the file's own times are of decoding, so that the n-th of `stamps` is the n-th picture's."""

    shifts: tuple[int, ...]
    """Where the file's times run backward: what to add to them, in ticks, before and after each such place."""

    counted: bool
    """Whether every packet is a picture, or none if it says so, so that missing ones are noticed."""

    first_key: int | None
    """When the first key frame appears, in the file's own ticks. What appears before it may lack what it builds on."""

    needed: int
    """Pictures from the first key frame on; what may stand still is not among them."""

    coarse: float
    """Seconds by which times are off where ticks cannot hold the rate, else 0."""


@dataclass(frozen=True)
class _Packet:
    stamp: int | None
    key: bool
    shown: bool
    nothing: bool
    """Empty, or saying "as before"."""


def survey(path: Path, container: av.container.InputContainer, stream: av.VideoStream) -> Packets:
    """Reads all packets of an opened file.

    Args:
        path: for sentences.
        container: at its beginning; it stands at its end afterwards.
        stream: the track whose pictures are wanted.

    Raises:
        BootifolError: the file is damaged, or ends too early.
    """
    kind = container.format.name
    # Of files in fragments the index grows while they are read.
    indexed = kind.startswith("mov") and stream.frames > 0
    promised = len(stream.index_entries) if indexed or kind == "avi" else 0
    packets: list[_Packet] = []
    delivered = 0
    end = 0.0
    cut = False
    try:
        for packet in container.demux():
            if packet.dts is None and packet.size == 0:
                continue  # the mark of a track's end
            if packet.pts is not None and packet.time_base:
                end = max(end, float((packet.pts + (packet.duration or 0)) * packet.time_base))
            if packet.stream_index == stream.index:
                delivered += 1
                cut = packet.is_corrupt
                packets.append(_read(packet, stream))
    except av.FFmpegError as error:
        raise truncated(path, delivered, promised, str(error.strerror)) from error
    if delivered == 0:
        raise BootifolError(f"{path} holds no pictures (damaged or truncated?): copy or export it again")
    if delivered < promised or (cut and not kind.startswith("mpegts")):
        raise truncated(path, delivered - cut, promised, "it ends too early")
    _require_its_end(path, container, end, end / delivered, indexed)
    return _packets(path, packets, stream, kind)


def truncated(path: Path, count: int, promised: int, why: str) -> BootifolError:
    """The sentence for a file of which some pictures can be read and some cannot."""
    of = f" of {promised}" if promised else ""
    return BootifolError(
        f"{path} is damaged or truncated: {count}{of} pictures could be read ({why}); copy or export it again"
    )


def _read(packet: av.Packet[Any], stream: av.VideoStream) -> _Packet:
    mpeg4 = stream.codec_context.name == "mpeg4"
    return _Packet(
        stamp=packet.pts if packet.pts is not None else packet.dts,
        key=packet.is_keyframe,
        shown=not packet.is_discard,
        nothing=packet.size == 0 or (mpeg4 and packet.size <= _LARGEST_NOTHING),
    )


def _require_its_end(
    path: Path, container: av.container.InputContainer, end: float, gap: float, indexed: bool
) -> None:
    kind = container.format.name
    size = path.stat().st_size
    promised = promised_bytes(path)
    if size < promised:
        raise BootifolError(
            f"{path} is truncated: it has {size:,} of {promised:,} bytes; copy or export it again"
        )
    missing = lacks_its_end(path, kind)
    if missing:
        raise BootifolError(f"{path} is truncated: {missing}; copy or export it again")
    fragments = fragments_end(path) if kind.startswith("mov") else None
    if fragments == "missing" and container.metadata.get("encoder", "").startswith("Lavf"):
        raise BootifolError(
            f"{path} is cut: it was written in fragments, and the index of them with which it should end (mfra) is "
            "missing; record it again, or keep what there is with `ffmpeg -i FILE -c copy WHOLE.mp4`"
        )
    declares = kind.startswith(("matroska", "flv", "asf")) or fragments is not None
    if declares and container.duration is not None:
        seconds = float(container.duration / av.time_base)
        # The last picture's own duration may not be known.
        if end + 1.5 * gap < seconds:
            raise BootifolError(
                f"{path} is truncated: its pictures end after {end:.2f} s of {seconds:.2f} s; copy or export it again"
            )
    by_marks = kind in ("gif", "ogg") or fragments == "there"
    by_length = fragments is None and (promised > 0 or (declares and container.duration is not None))
    if not (indexed or by_marks or by_length):
        warn("does not say how long it is: whether its end is missing cannot be told", path)


def _packets(path: Path, packets: Sequence[_Packet], stream: av.VideoStream, kind: str) -> Packets:
    tick = stream.time_base or Fraction(1, 1000)
    shown = [packet for packet in packets if packet.shown]
    known = [packet for packet in shown if packet.stamp is not None]
    stamps = sorted(_stamp(packet) for packet in known)
    timeless = kind in RAW_STREAMS.split() or len(known) < len(shown)
    reordered = kind == "avi" and bool(stream.codec_context.has_b_frames)
    segments = [known] if reordered else _segments(known)
    shifts = _shifts(segments, _usual_gap(stamps))
    if len(segments) > 1 and not timeless:
        warn("its times run backward: what follows was taken to begin where they do", path)
    key = next((packet.stamp for packet in packets if packet.key), None)
    leading = 0 if reordered else sum(_leading(segment) for segment in segments)
    return Packets(
        stamps=()
        if timeless
        else tuple(
            stamp + shift
            for segment, shift in zip(segments, shifts, strict=True)
            for stamp in sorted(map(_stamp, segment))
        ),
        tick=tick,
        reordered=reordered,
        shifts=shifts,
        counted=kind.startswith("mov") or kind == "avi",
        first_key=None if reordered else key,
        needed=sum(not packet.nothing for packet in shown) - leading,
        coarse=float(tick) if _rounded(stamps, stream) else 0.0,
    )


def _stamp(packet: _Packet) -> int:
    assert packet.stamp is not None
    return packet.stamp


def _segments(packets: Sequence[_Packet]) -> list[list[_Packet]]:
    """The packets, parted where times run backward: where a key frame appears before what was decoded before it."""
    segments: list[list[_Packet]] = []
    latest = 0
    for packet in packets:
        if not segments or (packet.key and _stamp(packet) < latest):
            segments.append([])
            latest = _stamp(packet)
        segments[-1].append(packet)
        latest = max(latest, _stamp(packet))
    return segments


def _shifts(segments: Sequence[Sequence[_Packet]], gap: int) -> tuple[int, ...]:
    """What to add to each segment's times so that it follows the one before it."""
    shifts: list[int] = []
    end = 0
    for segment in segments:
        stamps = [_stamp(packet) for packet in segment]
        shifts.append(end - min(stamps) if shifts else 0)
        end = max(stamps) + shifts[-1] + gap
    return tuple(shifts)


def _leading(segment: Sequence[_Packet]) -> int:
    """Pictures that appear before the first key frame, and may lack what they build on."""
    key = next((packet.stamp for packet in segment if packet.key), None)
    return sum(key is not None and _stamp(packet) < key and not packet.nothing for packet in segment)


def _usual_gap(stamps: Sequence[int]) -> int:
    gaps = np.diff(np.array(stamps, dtype=np.int64)) if len(stamps) > 1 else np.array([], np.int64)
    positive = gaps[gaps > 0]
    return int(np.median(positive)) if positive.size else 1


def _rounded(stamps: Sequence[int], stream: av.VideoStream) -> bool:
    """Whether times are those of a steady rate, rounded to ticks that cannot hold it: gaps of 33, 33 and 34."""
    gap = _usual_gap(stamps)
    if stream.average_rate and stream.time_base and 1 / (stream.average_rate * stream.time_base) == gap:
        return False
    gaps = np.diff(np.array(stamps, dtype=np.int64))
    near = gaps[np.abs(gaps - gap) <= 1]
    return bool(len(near) > 0.8 * len(gaps) and len(np.unique(near)) > 1)
