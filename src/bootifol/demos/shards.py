"""The files of a demo set: uint8 arrays in numpy's own format, of which single videos are read.

    shard-00000.npy   header | video 0 | video 1 | … | video n-1        each video: frames, rows, columns, RGB
    shard-00001.npy   header | video n | …

All shards but the last hold the same number of videos.
"""

from __future__ import annotations

import hashlib
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from bootifol.demos.manifest import Manifest, Shard
from bootifol.errors import BootifolError
from bootifol.files import DAMAGED_ARRAY, written_aside
from bootifol.types import FrameBatch, Frames

# Opening a set looks at every shard, so a set has few of them; and a shard is what an interrupted recording loses, so
# they are small.
_SHARD_BYTES = 16 * 2**20
_MOST_SHARDS = 128


def shard_name(index: int) -> str:
    """`shard-00007.npy` for 7."""
    return f"shard-{index:05d}.npy"


def shard_number(name: str) -> int:
    """7 for `shard-00007.npy`."""
    return int(name.removeprefix("shard-").removesuffix(".npy"))


def videos_per_shard(episodes: int | None, video_bytes: int) -> int:
    """How many videos each file of a set holds; `episodes` is None when their number is not known yet."""
    if episodes is None:
        return max(1, 8 * _SHARD_BYTES // video_bytes)
    return min(episodes, max(1, _SHARD_BYTES // video_bytes, math.ceil(episodes / _MOST_SHARDS)))


def write_shard(directory: Path, index: int, videos: FrameBatch) -> Shard:
    """Writes one shard, whole or not at all.

    Args:
        directory: of the demo set.
        index: number of the shard.
        videos: uint8 `[n, T + 1, H, W, 3]`.
    """
    path = directory / shard_name(index)
    with written_aside(path) as aside:
        with aside.open("wb") as file:
            np.save(file, np.ascontiguousarray(videos), allow_pickle=False)
        return Shard(
            file=path.name, videos=len(videos), bytes=aside.stat().st_size, sha256=sha256_of_file(aside)
        )


@dataclass(frozen=True)
class OpenShard:
    """A shard that was checked, ready to be read video by video.

    Reading copies the bytes of one video and no more into this process. A memory map would do as well, but all that was
    read through one counts as this process's memory until the system wants it back, and a file that is cut short
    meanwhile kills the process instead of raising an error.
    """

    path: Path
    videos: int
    offset: int
    """Bytes before the first video."""
    checksums: tuple[str, ...]
    """Of each video's pixels, as the manifest has them."""
    stamp: tuple[int, ...]
    """Of the file when it was opened: while it is the same, nobody has written to it."""

    def read(self, row: int, frames: Frames) -> None:
        """Fills `frames`, uint8 `[T + 1, H, W, 3]` in one piece of memory, with video `row`.

        Raises:
            BootifolError: the file is gone, is shorter than it was, or was replaced by another.
        """
        try:
            with self.path.open("rb") as file:
                file.seek(self.offset + row * frames.nbytes)
                complete = file.readinto(frames.data) == frames.nbytes
                changed = _stamp(os.fstat(file.fileno())) != self.stamp
        except OSError as error:
            raise BootifolError(
                f"{self.path} cannot be read any more: {error}; restore it and run the command again"
            ) from error
        if not complete:
            raise BootifolError(
                f"{self.path} has become shorter while it was in use: restore it or record the set again"
            )
        if changed and sha256_of_frames(frames) != self.checksums[row]:
            raise BootifolError(
                f"{self.path} was replaced or changed while it was in use: put back the videos that were learned from"
            )


def open_shard(directory: Path, shard: Shard, manifest: Manifest, first: int) -> OpenShard:
    """Makes the checks of a shard that cost nothing; only its header is read.

    Args:
        directory: of the demo set.
        shard: see there.
        manifest: of the set.
        first: number of the shard's first video in it.

    Raises:
        BootifolError: the file is missing, has another size than the manifest says, or another shape or type.
    """
    path = directory / shard.file
    try:
        status = path.stat()
        size = status.st_size
    except OSError:
        raise BootifolError(
            f"{path} is missing, and with it {shard.videos} videos: restore it or record the set again"
        ) from None
    if size != shard.bytes:
        kind = "truncated" if size < shard.bytes else "too long"
        raise BootifolError(
            f"{path} is {kind}: {size:,} bytes where the manifest says {shard.bytes:,}; "
            "restore it or record the set again"
        )
    try:
        with path.open("rb") as file:
            shape, dtype = _header(file)
            offset = file.tell()
    except DAMAGED_ARRAY as error:
        raise BootifolError(f"{path} is damaged: {error}; restore it or record the set again") from error
    expected = (shard.videos, manifest.frames, manifest.video_size, manifest.video_size, 3)
    if shape != expected or dtype != np.uint8:
        raise BootifolError(
            f"{path} holds {dtype} {list(shape)} where the manifest says uint8 {list(expected)}: "
            "restore it or record the set again"
        )
    if size != offset + math.prod(expected):
        raise BootifolError(
            f"{path} is damaged: {size - offset:,} bytes follow its header, which promises "
            f"{math.prod(expected):,}; restore it or record the set again"
        )
    checksums = tuple(video.sha256 for video in manifest.videos[first : first + shard.videos])
    return OpenShard(path, shard.videos, offset, checksums, _stamp(status))


def _stamp(status: os.stat_result) -> tuple[int, ...]:
    """What changes when a file is replaced or written to."""
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _header(file: BinaryIO) -> tuple[tuple[int, ...], np.dtype[np.generic]]:
    """Shape and type of the array in a .npy file, whose data begins where this stops reading."""
    version = np.lib.format.read_magic(file)
    if version != (1, 0):
        raise ValueError(f"its format is {version[0]}.{version[1]} where write_shard uses 1.0")
    shape, by_columns, dtype = np.lib.format.read_array_header_1_0(file)
    if by_columns:
        raise ValueError("its first axis varies fastest, so that its videos do not lie one after another")
    return shape, dtype


def sha256_of_file(path: Path) -> str:
    """Hexadecimal SHA-256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sha256_of_frames(frames: Frames) -> str:
    """Hexadecimal SHA-256 of the pixels in memory order."""
    return hashlib.sha256(np.ascontiguousarray(frames).data).hexdigest()


def last_frame_held(frames: Frames, length: int) -> Frames:
    """A video `[n, H, W, 3]` made `length` frames long by repeating its last one; `n` is at most `length`."""
    return np.concatenate([frames, np.repeat(frames[-1:], length - len(frames), axis=0)])
