"""The files of a demo set: uint8 arrays in numpy's own format, read through memory maps.

    shard-00000.npy   header | video 0 | video 1 | … | video n-1        each video: frames, rows, columns, RGB
    shard-00001.npy   header | video n | …

All shards but the last hold the same number of videos.
"""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np

from bootifol.demos.manifest import Manifest, Shard
from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.types import FrameBatch, Frames

# Each open map holds one of the usual 1024 file descriptors, so a set has few shards; and a shard is what an
# interrupted recording loses, so they are small.
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


def open_shard(directory: Path, shard: Shard, manifest: Manifest) -> FrameBatch:
    """The shard as a read-only memory map `[n, T + 1, H, W, 3]`, after the checks that cost nothing.

    Raises:
        BootifolError: the file is missing, has another size than the manifest says, or another shape or type.
    """
    path = directory / shard.file
    try:
        size = path.stat().st_size
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
        videos = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise BootifolError(f"{path} is damaged: {error}; restore it or record the set again") from error
    expected = (shard.videos, manifest.frames, manifest.video_size, manifest.video_size, 3)
    if not isinstance(videos, np.ndarray) or videos.shape != expected or videos.dtype != np.uint8:
        found = f"{videos.dtype} {list(videos.shape)}" if isinstance(videos, np.ndarray) else "not an array"
        raise BootifolError(
            f"{path} holds {found} where the manifest says uint8 {list(expected)}: "
            "restore it or record the set again"
        )
    return videos


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
