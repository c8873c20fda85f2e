"""Decodes video files picture by picture, as a player shows them, and notices what is missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import av

from bootifol.errors import BootifolError, warn
from bootifol.video_files.kinds import CONTAINERS, RAW_STREAMS, VIDEO_SUFFIXES, is_cover
from bootifol.video_files.orientation import TimedFrame, upright_frame
from bootifol.video_files.packets import Packets, survey, truncated
from bootifol.video_files.tone_mapping import is_hdr

Decode = Callable[["av.Packet[av.VideoStream]"], list[av.VideoFrame]]

_WITH_ALPHA = {"vp8": "libvpx", "vp9": "libvpx-vp9"}
"""Decoders that see what is transparent, for those of FFmpeg's own that do not."""


def stream_file(path: Path) -> Iterator[TimedFrame]:
    """Decodes a whole video file.

    Of several tracks it takes the default one, and of several such the largest. Pictures before the first key frame
    that lack what they build on are left out, as by players.

    Raises:
        BootifolError: the file is damaged, truncated or no video; at the latest at its end.
    """
    with _opened(path) as container:
        packets = survey(path, container, chosen_track(path, container, tell=True))
    count = 0
    first: float | None = None
    with _opened(path) as container:
        stream = chosen_track(path, container)
        clock = _Clock(packets)
        for frame in _decoded(path, container, stream, packets):
            time = clock.time(frame)
            if count == 0:
                first = time
                _tell_hdr(path, frame)
            lasts = float(frame.duration * frame.time_base) if frame.duration and frame.time_base else None
            seconds = None if time is None or first is None else time - first
            count += 1
            yield TimedFrame(upright_frame(frame, stream.sample_aspect_ratio), seconds, lasts, packets.coarse)
    if count == 0:
        raise BootifolError(f"{path} holds no pictures (damaged or truncated?): copy or export it again")
    if packets.counted and count < packets.needed:
        raise truncated(path, count, packets.needed, "some cannot be decoded")


def stream_part(path: Path, start: float, end: float) -> Iterator[TimedFrame]:
    """Decodes the pictures of a video file that appear from `start` until before `end`, in seconds of its clock.

    The file is entered at the key frame before `start`, not at its beginning. How many pictures there ought to be
    is for the caller to check.

    Raises:
        BootifolError: the file is damaged before `end`.
    """
    first: float | None = None
    with _opened(path) as container:
        stream = chosen_track(path, container)
        decode = _decoder(stream)
        try:
            if start > 0 and stream.time_base:
                container.seek(int(start / stream.time_base), stream=stream)
            for packet in container.demux(stream):
                for frame in decode(packet):
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


def shown_at(path: Path) -> tuple[float, ...]:
    """When the pictures of a file appear, ascending, in seconds of its clock; nothing is decoded.

    Raises:
        BootifolError: as `stream_file`.
    """
    return _shown_at(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=8)
def _shown_at(path: Path, changed: int) -> tuple[float, ...]:
    with _opened(path) as container:
        packets = survey(path, container, chosen_track(path, container))
    return tuple(float(stamp * packets.tick) for stamp in packets.stamps)


def declared_rate(path: Path) -> float | None:
    """Frames per second as a video file declares it; None where it does not."""
    with _opened(path) as container:
        rate = chosen_track(path, container).average_rate
        return float(rate) if rate and container.format.name not in RAW_STREAMS.split() else None


def chosen_track(path: Path, container: av.container.InputContainer, tell: bool = False) -> av.VideoStream:
    """The default one of a file's video tracks, and of several such the largest.

    Args:
        path: for sentences.
        container: the opened file.
        tell: whether to warn where there was a choice.

    Raises:
        BootifolError: there is none.
    """
    tracks = [stream for stream in container.streams.video if not is_cover(stream)]
    tracks = [track for track in tracks if track.codec_context is not None]
    if not tracks and container.streams.video:
        raise BootifolError(
            f"{path} holds no pictures of a kind that is read (damaged, or of an unknown codec): export it as H.264"
        )
    if not tracks:
        raise BootifolError(f"{path} holds no pictures (truncated, or sound only): give a whole video")
    chosen = max(tracks, key=lambda track: (bool(track.disposition & _DEFAULT), track.width * track.height))
    if tell and len(tracks) > 1:
        sizes = ", ".join(f"{track.width}×{track.height}" for track in tracks)
        warn(f"has {len(tracks)} video tracks ({sizes}): number {tracks.index(chosen) + 1} was taken", path)
    return chosen


_DEFAULT = av.stream.Disposition.default


class _Clock:
    """Says when decoded pictures appear, in seconds, also where a file's own times run backward.

    Args:
        packets: of the file.
    """

    def __init__(self, packets: Packets) -> None:
        self._packets = packets
        self._number = 0
        self._segment = 0
        self._latest: int | None = None

    def time(self, frame: av.VideoFrame) -> float | None:
        """When the next picture appears; None where the file does not say."""
        packets = self._packets
        number, self._number = self._number, self._number + 1
        if packets.reordered:
            return float(packets.stamps[number] * packets.tick) if number < len(packets.stamps) else None
        if not packets.stamps or frame.pts is None:
            return None
        if self._latest is not None and frame.pts < self._latest and self._segment + 1 < len(packets.shifts):
            self._segment += 1
        self._latest = frame.pts
        return float((frame.pts + packets.shifts[self._segment]) * packets.tick)


def _decoded(
    path: Path, container: av.container.InputContainer, stream: av.VideoStream, packets: Packets
) -> Iterator[av.VideoFrame]:
    """The pictures that a player shows, in its order."""
    decode = _decoder(stream)
    count = 0
    key_seen = False
    for packet in container.demux(stream):
        key_seen = key_seen or packet.is_keyframe
        try:
            frames = decode(packet)
        except av.FFmpegError as error:
            early = (
                packet.pts is not None and packets.first_key is not None and packet.pts < packets.first_key
            )
            if early or packet.is_discard or not key_seen:
                continue
            raise truncated(path, count, packets.needed, str(error.strerror)) from error
        for frame in frames:
            if frame.is_corrupt:
                early = (
                    frame.pts is not None and packets.first_key is not None and frame.pts < packets.first_key
                )
                if early and count == 0:
                    continue
                raise truncated(path, count, packets.needed, "a picture is corrupt")
            count += 1
            yield frame


def _decoder(stream: av.VideoStream) -> Decode:
    """Decodes the packets of a track, with what is transparent where it has that beside its pictures."""
    tags = {name.lower(): value for name, value in stream.metadata.items()}
    name = _WITH_ALPHA.get(stream.codec_context.name)
    if tags.get("alpha_mode") != "1" or name is None:
        return lambda packet: [frame for frame in packet.decode() if isinstance(frame, av.VideoFrame)]
    context = av.CodecContext.create(name, "r")
    context.extradata = stream.codec_context.extradata
    assert isinstance(context, av.VideoCodecContext)

    def decode(packet: av.Packet[av.VideoStream]) -> list[av.VideoFrame]:
        frames = context.decode(packet if packet.size else None)
        for frame in frames:
            frame.time_base = stream.time_base
        return frames

    return decode


def _tell_hdr(path: Path, frame: av.VideoFrame) -> None:
    if is_hdr(frame):
        warn(
            "is of high dynamic range (HLG or PQ): it was brought to a common screen's range, brighter parts white; "
            "look at the contact sheet, or film without HDR",
            path,
        )


@contextmanager
def _opened(path: Path) -> Iterator[av.container.InputContainer]:
    raw = RAW_STREAMS if path.suffix.lower() in VIDEO_SUFFIXES else ""
    formats = f"{CONTAINERS} {raw}".strip().replace(" ", ",")
    try:
        # Without "file:", `clip:1.mp4` would be the address 1.mp4 in a protocol called clip.
        container = av.open(f"file:{path}", options={"format_whitelist": formats})
    except (av.FFmpegError, ValueError) as error:
        raise BootifolError(
            f"{path} is damaged, truncated or no video ({error}): copy or export it again"
        ) from error
    with container:
        yield container
