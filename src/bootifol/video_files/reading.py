"""Finds and reads videos of any kind: files that FFmpeg decodes; folders of pictures; numpy arrays."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

from bootifol.errors import BootifolError, warn
from bootifol.video_files.animations import stream_animation
from bootifol.video_files.decoding import declared_rate, stream_file
from bootifol.video_files.folders_and_arrays import stream_archive, stream_array, stream_folder
from bootifol.video_files.kinds import PREVIEWS, UNFINISHED, Kind, is_apple_double, kind_of, refuse_stand_in
from bootifol.video_files.litter import children, is_systems_own
from bootifol.video_files.orientation import TimedFrame
from bootifol.video_files.picture_order import natural_order

VIDEO_KINDS: tuple[Kind, ...] = ("array", "archive", "video", "animation")

LeftOut = dict[str, list[Path]]
"""Files and folders that were not taken, by the reason."""


def video_paths(paths: Sequence[Path]) -> list[Path]:
    """Finds the videos people mean: a folder stands for the videos in it and below it, or for one as pictures.

    What a folder holds besides is named in a `BootifolWarning`, but for what systems leave everywhere.

    Returns:
        Files and folders of pictures that `stream_video` reads, folders' contents in natural order of their names;
        and LeRobot datasets, each as its one directory.

    Raises:
        BootifolError: a folder holds neither pictures nor videos.
    """
    found: list[Path] = []
    left_out: LeftOut = defaultdict(list)
    for path in paths:
        if path.is_dir() and not is_lerobot_dataset(path):
            inside = _videos_in(path, left_out, frozenset())
            if not inside:
                others = ", ".join(_few([file.name for files in left_out.values() for file in files]))
                raise BootifolError(
                    f"{path} holds no videos{f' (it holds {others})' if others else ''}: give video files, or folders "
                    "of them or of pictures (png, jpg, webp, bmp, tif)"
                )
            found += inside
        elif path.is_file() and (is_apple_double(path) or is_systems_own(path)):
            left_out["left there by the system"].append(path)
        else:
            found.append(path)
    # As `folder/*` names them.
    stills = [
        path
        for path in found
        if path.is_file() and path.suffix.lower() != ".gif" and kind_of(path) == "picture"
    ]
    if len(stills) < len(found):
        found = [path for path in found if path not in set(stills)]
        left_out["pictures beside videos"] += stills
    for reason, files in list(left_out.items()):
        if not files:
            del left_out[reason]
    for reason, files in left_out.items():
        warn(f"left out {', '.join(_few([str(file) for file in files]))}: {reason}")
    return found


def is_lerobot_dataset(path: Path) -> bool:
    """Whether a directory is laid out as a LeRobot dataset; `lerobot_reading` reads those."""
    return (path / "meta" / "info.json").is_file()


def stream_video(path: Path) -> Iterator[TimedFrame]:
    """Decodes a video picture by picture, so that a long one fits in memory.

    Args:
        path: a file that FFmpeg decodes; a folder of pictures, taken in the order of their names (`frame2` before
            `frame10`); a picture file with several frames (webp, png, tiff, avif); a .npy file, uint8
            `[frames, H, W, 3]`; or a .npz file with one such array among its arrays.

    Raises:
        BootifolError: the file is missing, empty, damaged, truncated or no video; at the latest at its end.
    """
    if path.is_dir():
        yield from stream_folder(path)
        return
    if not path.exists():
        raise BootifolError(f"{path} does not exist: give video files, folders of pictures or .npy arrays")
    if path.stat().st_size == 0:
        raise BootifolError(f"{path} is empty (0 bytes): copy or export it again")
    refuse_stand_in(path)
    kind = kind_of(path)
    if kind == "array":
        yield from stream_array(path)
    elif kind == "archive":
        yield from stream_archive(path)
    elif kind == "animation":
        yield from stream_animation(path)
    elif kind == "video" or path.suffix.lower() == ".gif":
        yield from stream_file(path)
    elif kind == "picture":
        raise BootifolError(f"{path} is one picture, no video: give a folder of the pictures of one video")
    else:
        raise BootifolError(
            f"{path} is not a video bootifol reads: give mp4, mov, webm, mkv, avi, gif, mpg, ts, .npy or .npz files, "
            "or folders of pictures (png, jpg, webp, bmp, tif)"
        )


def frame_rate(path: Path) -> float | None:
    """Frames per second as a video file declares it; None for folders, arrays and files that do not."""
    return declared_rate(path) if path.is_file() and kind_of(path) == "video" else None


def _videos_in(folder: Path, left_out: LeftOut, above: frozenset[Path]) -> list[Path]:
    """What `video_paths` finds in a folder; `above` are the folders around it, for links may lead in circles."""
    above |= {folder.resolve()}
    kinds: dict[Path, Kind] = {}
    below: dict[Path, list[Path]] = {}
    others: LeftOut = defaultdict(list)
    for child in sorted(children(folder), key=natural_order):
        if child.is_dir():
            if is_lerobot_dataset(child):
                below[child] = [child]
            elif child.resolve() not in above:
                below[child] = _videos_in(child, others, above)
        elif child.is_file():
            kinds[child] = kind_of(child)
        else:
            others["links to files that are missing (`git annex get` fetches those of git-annex)"].append(
                child
            )
    pictures = [child for child, kind in kinds.items() if kind == "picture"]
    videos = [child for child, kind in kinds.items() if kind in VIDEO_KINDS]
    files_below = any(file.is_file() for found in below.values() for file in found)
    for child, kind in kinds.items():
        if kind == "other":
            others[_why(child)].append(child)
    if pictures and not videos and not files_below and (len(pictures) > 1 or not any(below.values())):
        others["folders in a folder of pictures"] += [child for child, found in below.items() if found]
        found = [folder]
    else:
        others["pictures beside videos"] += pictures
        every = {child: [child] for child in videos} | below
        found = [path for child in sorted(every, key=natural_order) for path in every[child]]
    for reason, files in others.items():
        left_out[reason] += files
    for reason in [reason for reason, files in left_out.items() if not files]:
        del left_out[reason]
    return found


def _why(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix in PREVIEWS:
        return "small previews that cameras make"
    if suffix in UNFINISHED:
        return "not downloaded or copied to their end"
    return "no videos, or of a kind that is not read"


def _few(names: Sequence[str], most: int = 8) -> list[str]:
    return [*names[:most], f"{len(names) - most} more"] if len(names) > most else list(names)
