"""Which kind of recording a file is, by its suffix and its first bytes; and what only stands in for one."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import av
from av.stream import Disposition
from PIL import Image

from bootifol.errors import BootifolError
from bootifol.video_files.file_ends import gif_is_whole

Kind = Literal["array", "archive", "video", "animation", "picture", "other"]
"""array: .npy. archive: .npz. video: what FFmpeg decodes. animation: a picture file with several frames (webp, png,
tiff, avif). picture: a still one, of which a folder is a video. other: nothing that is read here."""


def _suffixes(listed: str) -> frozenset[str]:
    return frozenset(listed.split())


VIDEO_SUFFIXES = _suffixes(
    ".mp4 .m4v .mov .qt .3gp .3g2 .f4v .mj2 .mkv .webm .avi .divx .gif .ts .mts .m2ts .m2t .mpg .mpeg .mpe "
    ".vob .m2v .m1v .mpv .flv .wmv .asf .ogv .ogm .mxf .nut .ivf .y4m .mjpg .mjpeg .h264 .264 .avc .h265 "
    ".265 .hevc .obu .dv .rm .rmvb .wtv .gxf .swf .amv"
)
"""Suffixes that promise a video: such a file is read or refused, never left out."""

PICTURE_SUFFIXES = _suffixes(
    ".png .apng .jpg .jpeg .jpe .jfif .jp2 .j2k .j2c .jpf .jpx .webp .avif .bmp .dib .tif .tiff .ppm .pgm .pbm .pnm "
    ".pfm .tga .icb .vda .vst .pcx .sgi .rgb .rgba .bw .qoi .dds .ras .ico"
)
"""Still pictures that Pillow reads, without those that are drawings, maps or measurements."""

OTHER_PICTURES = _suffixes(
    ".heic .heif .hif .dng .cr2 .cr3 .nef .arw .raf .orf .rw2 .psd .svg .exr .hdr .jxl"
)
"""Pictures that are not read, some of which FFmpeg would take for videos."""

PREVIEWS = frozenset((".lrv", ".lrf", ".thm"))
"""Small copies that cameras put beside their videos."""

UNFINISHED = frozenset((".part", ".crdownload", ".download", ".partial", ".tmp", ".icloud"))
"""Files whose download or copy has not ended."""

_MAYBE_ANIMATED = frozenset((".png", ".apng", ".webp", ".avif", ".tif", ".tiff"))
"""Not JPEG, where a phone's second picture is a preview or a brighter copy, and not GIF, which FFmpeg decodes."""

CONTAINERS = (
    "mov,mp4,m4a,3gp,3g2,mj2 matroska,webm avi gif mpegts mpeg flv asf ogg mxf nut ivf "
    "yuv4mpegpipe dv rm wtv gxf swf"
)
"""FFmpeg's names of formats that hold videos and say so; it also plays text files and lists of other files."""

RAW_STREAMS = "h264 hevc vvc av1 obu m4v mpegvideo mjpeg"
"""Pictures alone, one after another, without a word about time: believed only where the suffix says so."""

_STAND_INS = (
    (
        b"version https://git-lfs.github.com/spec/",
        "is a pointer of Git LFS, not the file: type `git lfs pull`",
    ),
    (b"/annex/objects/", "is a pointer of git-annex, not the file: type `git annex get`"),
    (b"\x00\x05\x16\x07", "holds what macOS notes beside a file (AppleDouble), no pictures: leave it out"),
    (b"<!doctype html", "is a web page, not the file that it links to: download the file itself"),
    (b"<html", "is a web page, not the file that it links to: download the file itself"),
)


def refuse_stand_in(path: Path) -> None:
    """Refuses files that stand where another should: pointers of Git LFS, notes of macOS, saved web pages.

    Raises:
        BootifolError: it is one, or cannot be opened.
    """
    head = first_bytes(path, 200)
    for mark, what in _STAND_INS:
        if head.lstrip().lower().startswith(mark):
            raise BootifolError(f"{path} {what}")


def is_apple_double(path: Path) -> bool:
    """Whether a file is macOS's `._` note about another."""
    return path.name.startswith("._") and first_bytes(path, 4) == b"\x00\x05\x16\x07"


def kind_of(path: Path) -> Kind:
    """The kind of a file; it is opened only where its suffix does not tell.

    Raises:
        BootifolError: it cannot be opened.
    """
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return "array"
    if suffix == ".npz":
        return "archive"
    if suffix in OTHER_PICTURES or suffix in PREVIEWS or suffix in UNFINISHED:
        return "other"
    if suffix in _MAYBE_ANIMATED or first_bytes(path, 12)[8:] == b"WEBP":
        return "animation" if _has_several_frames(path) else "picture"
    if suffix == ".gif":
        return "picture" if _is_one_picture(path) else "video"
    if suffix in VIDEO_SUFFIXES:
        return "video"
    if suffix in PICTURE_SUFFIXES:
        return "picture"
    return "video" if _is_container(path) else "other"


def is_cover(stream: av.VideoStream) -> bool:
    """Whether a track is no video but a picture of the file itself, as music has them, or a strip of thumbnails."""
    return bool(stream.disposition & (Disposition.attached_pic | Disposition.timed_thumbnails))


def first_bytes(path: Path, count: int) -> bytes:
    """The beginning of a file.

    Raises:
        BootifolError: it cannot be opened.
    """
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError as error:
        raise BootifolError(f"{path} cannot be read: {error.strerror}") from error


def _has_several_frames(path: Path) -> bool:
    try:
        with Image.open(path) as picture:
            return picture.format != "MPO" and int(getattr(picture, "n_frames", 1)) > 1
    except Exception:  # a damaged one makes Pillow raise anything; reading it says what is wrong
        return False


def _is_one_picture(path: Path) -> bool:
    """Whether a GIF surely is a still picture; a damaged one is left to the decoder, which says what is wrong."""
    try:
        with Image.open(path) as picture:
            return getattr(picture, "n_frames", 2) == 1 and gif_is_whole(path)
    except Exception:  # as above
        return False


def _is_container(path: Path) -> bool:
    """Whether FFmpeg finds a video in a file of unknown suffix."""
    try:
        with av.open(f"file:{path}", options={"format_whitelist": CONTAINERS.replace(" ", ",")}) as container:
            return any(not is_cover(stream) for stream in container.streams.video)
    except (av.FFmpegError, ValueError):
        return False
