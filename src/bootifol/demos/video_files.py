"""Finds and reads videos of any kind: mp4, gif, webm, mov …; folders of pictures; numpy arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from bootifol.demos.decoding import declared_rate, stream_file
from bootifol.demos.folders_and_arrays import (
    natural_order,
    pictures_in,
    stream_archive,
    stream_array,
    stream_folder,
)
from bootifol.demos.upright import TimedFrame
from bootifol.errors import BootifolError

VIDEO_SUFFIXES = (".mp4", ".mov", ".m4v", ".webm", ".mkv", ".avi", ".gif")
ARRAY_SUFFIXES = (".npy", ".npz")


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
        if not path.is_dir() or is_lerobot_dataset(path) or pictures_in(path):
            found.append(path)
            continue
        inside = [
            child
            for child in sorted(path.iterdir(), key=natural_order)
            if child.suffix.lower() in (*VIDEO_SUFFIXES, *ARRAY_SUFFIXES)
            or (child.is_dir() and (is_lerobot_dataset(child) or pictures_in(child)))
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
        yield from stream_folder(path)
    elif not path.exists():
        raise BootifolError(f"{path} does not exist: give video files, folders of pictures or .npy arrays")
    elif path.stat().st_size == 0:
        raise BootifolError(f"{path} is empty (0 bytes): copy or export it again")
    elif path.suffix.lower() == ".npy":
        yield from stream_array(path)
    elif path.suffix.lower() == ".npz":
        yield from stream_archive(path)
    elif path.suffix.lower() in VIDEO_SUFFIXES:
        yield from stream_file(path)
    else:
        raise BootifolError(
            f"{path} is not a video bootifol reads: give {', '.join(VIDEO_SUFFIXES)}, .npy or .npz "
            "files, or folders of png or jpg pictures"
        )


def frame_rate(path: Path) -> float | None:
    """Frames per second as a video file declares it; None for folders, arrays and files that do not."""
    if path.is_dir() or path.suffix.lower() not in VIDEO_SUFFIXES:
        return None
    return declared_rate(path)
