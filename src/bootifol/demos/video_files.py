"""Video files in and out: mp4, gif, webm, mov; folders of pictures; numpy arrays."""

from __future__ import annotations

import math
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from bootifol.demos.shards import DAMAGED_ARRAY
from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.types import Frame, Frames

VIDEO_SUFFIXES = (".mp4", ".mov", ".m4v", ".webm", ".mkv", ".avi", ".gif")
ARRAY_SUFFIXES = (".npy", ".npz")
PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg")

# People look at these videos: enlarge small pictures to at least this many pixels.
_SMALLEST_SHOWN = 256

# Pixels longer than this are a damaged header, not a format that anyone films in (the widest, anamorphic, is 2).
_MOST_STRETCHED = 4


@dataclass(frozen=True)
class TimedFrame:
    """One picture of a video and when it appears."""

    frame: Frame
    """uint8 `[H, W, 3]` RGB, upright."""

    seconds: float | None
    """After the first frame; None when the file does not know (folders of pictures, arrays)."""


def video_paths(paths: Sequence[Path]) -> list[Path]:
    """Finds the videos people mean: a folder without pictures of its own stands for the videos in it.

    Returns:
        Files and folders of pictures that `stream_video` reads, folders' contents in natural order of their names;
        and LeRobot datasets, each as its one directory.

    Raises:
        BootifolError: a folder holds neither pictures nor videos.
    """
    found: list[Path] = []
    for path in paths:
        if not path.is_dir() or is_lerobot_dataset(path) or _pictures(path):
            found.append(path)
            continue
        inside = [
            child
            for child in sorted(path.iterdir(), key=_natural_order)
            if child.suffix.lower() in (*VIDEO_SUFFIXES, *ARRAY_SUFFIXES)
            or (child.is_dir() and (is_lerobot_dataset(child) or _pictures(child)))
        ]
        if not inside:
            raise BootifolError(
                f"{path} holds no videos: give video files, or folders of them or of pictures"
            )
        found += inside
    return found


def is_lerobot_dataset(path: Path) -> bool:
    """Whether a directory is laid out as a LeRobot dataset; `demos.lerobot` reads those."""
    return (path / "meta" / "info.json").is_file()


def stream_video(path: Path) -> Iterator[TimedFrame]:
    """Decodes a video picture by picture, so that a long one fits in memory.

    Args:
        path: an mp4, mov, webm, gif … file; a folder of png or jpg pictures, taken in natural order of their
            names (`frame2` before `frame10`); a .npy file, uint8 `[frames, H, W, 3]`; or a .npz file with one
            such array among its arrays.

    Raises:
        BootifolError: the file is missing, empty, damaged, truncated or no video; at the latest at its end.
    """
    if path.is_dir():
        yield from _stream_folder(path)
    elif not path.exists():
        raise BootifolError(f"{path} does not exist: give video files, folders of pictures or .npy arrays")
    elif path.stat().st_size == 0:
        raise BootifolError(f"{path} is empty (0 bytes): copy or export it again")
    elif path.suffix.lower() == ".npy":
        yield from _stream_array(path)
    elif path.suffix.lower() == ".npz":
        yield from _stream_archive(path)
    elif path.suffix.lower() in VIDEO_SUFFIXES:
        yield from _stream_file(path)
    else:
        raise BootifolError(
            f"{path} is not a video bootifol reads: give {', '.join(VIDEO_SUFFIXES)}, .npy or .npz "
            "files, or folders of png or jpg pictures"
        )


def read_video(path: Path) -> Frames:
    """All pictures of a video, uint8 `[frames, H, W, 3]`; errors as `stream_video`."""
    return np.stack([timed.frame for timed in stream_video(path)])


def frame_rate(path: Path) -> float | None:
    """Frames per second as a video file declares it; None for folders, arrays and files that do not."""
    if path.is_dir() or path.suffix.lower() not in VIDEO_SUFFIXES:
        return None
    with _opened(path) as container:
        rate = container.streams.video[0].average_rate
        return float(rate) if rate else None


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


def _stream_folder(path: Path) -> Iterator[TimedFrame]:
    pictures = _pictures(path)
    if not pictures:
        raise BootifolError(f"{path} holds no pictures: a folder should hold one video as png or jpg files")
    size: tuple[int, int] | None = None
    for file in pictures:
        try:
            with Image.open(file) as picture:
                frame = _picture(picture)
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
            raise BootifolError(f"{file} is damaged or no picture: {error}") from error
        if size is not None and frame.shape[:2] != size:
            raise BootifolError(
                f"{file} is {frame.shape[1]}×{frame.shape[0]} pixels and the pictures before it are "
                f"{size[1]}×{size[0]}: one folder should hold one video"
            )
        size = frame.shape[:2]
        yield TimedFrame(frame, None)


def _pictures(folder: Path) -> list[Path]:
    pictures = (file for file in folder.iterdir() if file.suffix.lower() in PICTURE_SUFFIXES)
    return sorted(pictures, key=_natural_order)


def _natural_order(path: Path) -> list[tuple[int, str]]:
    return [
        (int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name.lower())
    ]


def _stream_array(path: Path) -> Iterator[TimedFrame]:
    try:
        frames = np.load(path, mmap_mode="r", allow_pickle=False)
    except DAMAGED_ARRAY as error:
        raise BootifolError(f"{path} is damaged or no numpy array: {error}") from error
    if frames.dtype != np.uint8 or frames.ndim != 4 or frames.shape[-1] != 3 or frames.size == 0:
        raise BootifolError(
            f"{path} holds {frames.dtype} {list(frames.shape)}: a video is uint8 [frames, height, width, 3]"
        )
    for frame in frames:
        yield TimedFrame(np.array(frame), None)


def _stream_archive(path: Path) -> Iterator[TimedFrame]:
    try:
        inside = _arrays_inside(path)
        videos = [
            name
            for name, (shape, dtype) in inside.items()
            if dtype == np.uint8 and len(shape) == 4 and shape[-1] == 3 and math.prod(shape) > 0
        ]
        if len(videos) != 1:
            listed = ", ".join(f"{name} {dtype} {list(shape)}" for name, (shape, dtype) in inside.items())
            raise BootifolError(
                f"{path} holds {len(videos) or 'no'} arrays that could be the video, uint8 [frames, height, "
                f"width, 3], among {listed or 'nothing'}: save the one video alone"
            )
        frames = np.load(path, allow_pickle=False)[videos[0]]
    except (*DAMAGED_ARRAY, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise BootifolError(f"{path} is damaged or no .npz archive: {error}") from error
    for frame in frames:
        yield TimedFrame(np.array(frame), None)


def _arrays_inside(path: Path) -> dict[str, tuple[tuple[int, ...], np.dtype[np.generic]]]:
    """Shape and type of the arrays in an archive by their names; only the headers are read, nothing is unpickled."""
    inside = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.namelist():
            if not member.endswith(".npy"):
                continue
            with archive.open(member) as file:
                version = np.lib.format.read_magic(file)
                read_header = (
                    np.lib.format.read_array_header_1_0
                    if version == (1, 0)
                    else np.lib.format.read_array_header_2_0
                )
                shape, _, dtype = read_header(file)
            inside[member.removesuffix(".npy")] = (shape, dtype)
    return inside


def _stream_file(path: Path) -> Iterator[TimedFrame]:
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
                yield TimedFrame(_upright(frame, stream.sample_aspect_ratio), seconds - first)
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
                yield TimedFrame(_upright(frame, stream.sample_aspect_ratio), frame.time - first)
        except av.FFmpegError as error:
            raise BootifolError(
                f"{path} is damaged or truncated between {start:.2f} and {end:.2f} s ({error.strerror}): "
                "copy or export it again"
            ) from error


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


def _upright(frame: av.VideoFrame, pixel_aspect: Fraction | None) -> Frame:
    """The picture as people see it.

    What is transparent is white. Pixels that are not square are stretched, never shrunk. Phones store portrait videos
    lying down, with a note how to turn them.

    Args:
        frame: as decoded.
        pixel_aspect: width of a pixel divided by its height; None and nonsense count as 1.
    """
    if any(component.is_alpha for component in frame.format.components):
        pixels = over_white(np.asarray(frame.to_ndarray(format="rgba"), np.uint8))
    else:
        pixels = np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
    if pixel_aspect and pixel_aspect != 1 and 1 / _MOST_STRETCHED <= pixel_aspect <= _MOST_STRETCHED:
        height, width = pixels.shape[:2]
        square = (round(width * max(1, pixel_aspect)), round(height * max(1, 1 / pixel_aspect)))
        pixels = np.asarray(Image.fromarray(pixels).resize(square, Image.Resampling.BILINEAR))
    return np.ascontiguousarray(np.rot90(pixels, k=round(frame.rotation / 90)))


def over_white(pixels: NDArray[np.uint8]) -> Frame:
    """A picture with alpha, uint8 `[H, W, 4]`, on a white ground as browsers show it: uint8 `[H, W, 3]`."""
    alpha = pixels[..., 3:].astype(np.uint16)
    blended: Frame = ((pixels[..., :3] * alpha + 255 * (255 - alpha) + 127) // 255).astype(np.uint8)
    return blended


def _picture(picture: Image.Image) -> Frame:
    """A still picture upright, transparent places white, 16 bits a pixel scaled to 8: uint8 `[H, W, 3]`."""
    upright = ImageOps.exif_transpose(picture)
    if upright.has_transparency_data:
        return over_white(np.asarray(upright.convert("RGBA")))
    if upright.mode.startswith("I"):  # otherwise all above 255 of 65535 would be white
        upright = Image.fromarray((np.asarray(upright) >> 8).clip(0, 255).astype(np.uint8))
    return np.asarray(upright.convert("RGB"))


def _truncated(path: Path, count: int, promised: int, why: str) -> BootifolError:
    of = f" of {promised}" if promised else ""
    return BootifolError(
        f"{path} is damaged or truncated: {count}{of} pictures could be read ({why}); copy or export it again"
    )
