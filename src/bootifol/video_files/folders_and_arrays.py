"""Videos that are no video files: folders of pictures, and numpy arrays."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from bootifol.errors import BootifolError
from bootifol.files import DAMAGED_ARRAY
from bootifol.video_files.kinds import PICTURE_SUFFIXES, kind_of, refuse_stand_in
from bootifol.video_files.litter import children
from bootifol.video_files.orientation import TimedFrame, upright_picture
from bootifol.video_files.picture_order import in_order

LARGEST_UNFOLDED = 1_000_000_000
"""Bytes of an array in an archive, which is read in one piece, above which `LARGEST_RATIO` holds."""

LARGEST_RATIO = 100
"""Of an array's bytes to those of its archive; what was drawn with few colors has up to about 50."""


def stream_folder(path: Path) -> Iterator[TimedFrame]:
    """Reads a folder of pictures as one video, in the order of their names; errors are `BootifolError`."""
    pictures = in_order(pictures_in(path))
    if not pictures:
        raise BootifolError(
            f"{path} holds no pictures: a folder should hold one video as png, jpg, webp, bmp or tif files"
        )
    size: tuple[int, int] | None = None
    for file in pictures:
        if not file.is_file():
            raise BootifolError(f"{file} is no file: take it out of the pictures")
        refuse_stand_in(file)
        try:
            with Image.open(file) as picture:
                frame = upright_picture(picture)
        except Exception as error:  # damaged ones make Pillow raise anything
            raise BootifolError(f"{file} is damaged or no picture: {error}") from error
        if size is not None and frame.shape[:2] != size:
            raise BootifolError(
                f"{file} is {frame.shape[1]}×{frame.shape[0]} pixels and the pictures before it are "
                f"{size[1]}×{size[0]}: one folder should hold one video"
            )
        size = frame.shape[:2]
        yield TimedFrame(frame, None)


def pictures_in(folder: Path) -> list[Path]:
    """The still pictures of a folder; also what is named like one and is no file, which nothing may open."""
    return [child for child in children(folder) if _is_picture(child)]


def _is_picture(path: Path) -> bool:
    if path.is_file():
        return kind_of(path) == "picture"
    return not path.is_dir() and path.suffix.lower() in PICTURE_SUFFIXES


def stream_array(path: Path) -> Iterator[TimedFrame]:
    """Reads a .npy file, uint8 `[frames, H, W, 3]`; errors are `BootifolError`."""
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


def stream_archive(path: Path) -> Iterator[TimedFrame]:
    """Reads the one video of a .npz archive; errors are `BootifolError`."""
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
        unfolded = math.prod(inside[videos[0]][0])
        if unfolded > LARGEST_UNFOLDED and unfolded > LARGEST_RATIO * path.stat().st_size:
            raise BootifolError(
                f"{path} unfolds from {path.stat().st_size:,} bytes to {unfolded:,}, which no video does: save the "
                "video as a .npy file"
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
