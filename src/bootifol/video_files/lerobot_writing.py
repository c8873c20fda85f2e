"""Writing a LeRobot dataset of format v3: videos and the tables that say where each episode is.

Demo sets have pictures only, so there are no actions and no states in it; everything else that LeRobot's reader
asks for is there. Frames keep their size, and their pixels up to the rounding of colors (two levels of 255).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bootifol.files import write_json
from bootifol.types import Frame, Frames
from bootifol.video_files.lerobot_reading import EPISODES_DIRECTORY, INFO_PATH, parquet_library
from bootifol.video_files.writing import encoded_video, exact_rate

CAMERA = "observation.image"
"""The name of the one camera."""

_VERSION = "v3.0"
_FIRST_FILE = "chunk-000/file-000.parquet"
_DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_FILES_PER_CHUNK = 1000
_DATA_FILE_MB = 100
_VIDEO_FILE_MB = 200
_PIXEL_BYTES_PER_FILE = 256 * 2**20
"""A video file is full at so many bytes of pixels; encoded, even photographs stay below `_VIDEO_FILE_MB`."""
# Without loss; a key frame at least every second frame, as LeRobot writes them, so that readers can jump; no frame
# depends on a later one.
_ENCODER = {"qp": "0", "preset": "fast", "g": "2", "bf": "0"}
_COLUMNS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Columns of the frames' table, one row a frame."""

_Stats = dict[str, NDArray[np.float64]]


def write_lerobot(
    directory: Path,
    episodes: Iterable[Frames],
    frames_per_second: float,
    task: str,
    advance: Callable[[], None],
) -> None:
    """Writes a whole dataset into a directory; the caller writes aside.

    Args:
        directory: of the dataset; it exists and is empty.
        episodes: the frames of each, uint8 `[n, H, W, 3]`, all of one size; at least one.
        frames_per_second: of all videos.
        task: what they show, in words.
        advance: called after each episode.

    Raises:
        BootifolError: pyarrow is missing, or the frame rate is impossible.
    """
    parquet = parquet_library()
    import pyarrow

    rate = exact_rate(frames_per_second)
    data_file = directory / "data" / _FIRST_FILE
    data_file.parent.mkdir(parents=True)
    schema = pyarrow.schema([(name, getattr(pyarrow, kind)()) for name, kind in _COLUMNS.items()])
    rows: list[dict[str, Any]] = []
    stats: list[dict[str, _Stats]] = []
    total = height = width = 0
    with _VideoWriter(directory, rate) as videos, parquet.ParquetWriter(data_file, schema) as table:
        for index, frames in enumerate(episodes):
            (height, width), length = frames.shape[1:3], len(frames)
            columns = _columns(index, total, length, rate)
            stats.append(
                {CAMERA: _picture_stats(frames)} | {name: _stats(of) for name, of in columns.items()}
            )
            table.write_table(pyarrow.table(columns, schema=schema))
            rows.append(
                {"episode_index": index, "tasks": [task], "length": length}
                | {"data/chunk_index": 0, "data/file_index": 0}
                | {"dataset_from_index": total, "dataset_to_index": total + length}
                | videos.add(frames)
                | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
                | {
                    f"stats/{name}/{what}": v.tolist()
                    for name, of in stats[-1].items()
                    for what, v in of.items()
                }
            )
            total += length
            advance()
    episodes_file = directory / EPISODES_DIRECTORY / _FIRST_FILE
    episodes_file.parent.mkdir(parents=True)
    parquet.write_table(pyarrow.Table.from_pylist(rows), episodes_file)
    parquet.write_table(_tasks_table(task), directory / "meta" / "tasks.parquet")
    pooled = {name: _pooled([of[name] for of in stats]) for name in stats[0]}
    write_json(
        directory / "meta" / "stats.json",
        {name: {what: value.tolist() for what, value in of.items()} for name, of in pooled.items()},
    )
    write_json(directory / INFO_PATH, _info(len(rows), total, rate, height, width))


@dataclass
class _VideoWriter:
    """Episodes one after another in mp4 files, a new file when one has reached its size."""

    directory: Path
    rate: Fraction
    number: int = -1
    frames_in_file: int = 0
    _stack: ExitStack = field(default_factory=ExitStack)
    _add: Callable[[Frame], None] | None = None

    def __enter__(self) -> _VideoWriter:
        return self

    def __exit__(self, *error: Any) -> None:
        self._stack.__exit__(*error)

    def add(self, frames: Frames) -> dict[str, int | float]:
        """Writes one episode and returns the columns that say where it is."""
        if self._add is None or self.frames_in_file * frames[0].nbytes >= _PIXEL_BYTES_PER_FILE:
            self._begin_file(frames.shape[1], frames.shape[2])
        assert self._add is not None
        first = self.frames_in_file
        for frame in frames:
            self._add(frame)
        self.frames_in_file += len(frames)
        chunk, file = divmod(self.number, _FILES_PER_CHUNK)
        return {
            f"videos/{CAMERA}/chunk_index": chunk,
            f"videos/{CAMERA}/file_index": file,
            f"videos/{CAMERA}/from_timestamp": float(first / self.rate),
            f"videos/{CAMERA}/to_timestamp": float(self.frames_in_file / self.rate),
        }

    def _begin_file(self, height: int, width: int) -> None:
        self._stack.close()
        self.number += 1
        self.frames_in_file = 0
        chunk, file = divmod(self.number, _FILES_PER_CHUNK)
        path = self.directory / _VIDEO_PATH.format(video_key=CAMERA, chunk_index=chunk, file_index=file)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._add = self._stack.enter_context(
            encoded_video(path, (height, width), self.rate, "yuv444p", _ENCODER)
        )


def _columns(episode: int, first: int, length: int, rate: Fraction) -> dict[str, NDArray[Any]]:
    """The rows of one episode in the frames' table, `[length]` each."""
    frame_index = np.arange(length)
    values = {
        "timestamp": frame_index / float(rate),
        "frame_index": frame_index,
        "episode_index": np.full(length, episode),
        "index": first + frame_index,
        "task_index": np.zeros(length),
    }
    return {name: values[name].astype(kind) for name, kind in _COLUMNS.items()}


def _picture_stats(frames: Frames) -> _Stats:
    """Per channel, `[3, 1, 1]`, of values from 0 to 1; `count` is the number of frames."""
    pixels = frames.reshape(-1, 3).T / 255.0
    of_channels = {name: value.reshape(3, 1, 1) for name, value in _stats(pixels).items() if name != "count"}
    return of_channels | {"count": np.array([len(frames)])}


def _stats(values: NDArray[Any]) -> _Stats:
    """Along the last axis, which is kept."""
    return {
        "min": values.min(-1, keepdims=True),
        "max": values.max(-1, keepdims=True),
        "mean": values.mean(-1, keepdims=True, dtype=np.float64),
        "std": values.std(-1, keepdims=True, dtype=np.float64),
        "count": np.array([values.shape[-1]]),
    }


def _pooled(parts: list[_Stats]) -> _Stats:
    """The statistics of all parts together."""
    weights = np.array([float(part["count"][0]) for part in parts])
    weights /= weights.sum()
    mean = sum(weight * part["mean"] for weight, part in zip(weights, parts, strict=True))
    variance = sum(
        weight * (part["std"] ** 2 + (part["mean"] - mean) ** 2)
        for weight, part in zip(weights, parts, strict=True)
    )
    return {
        "min": np.min([part["min"] for part in parts], axis=0),
        "max": np.max([part["max"] for part in parts], axis=0),
        "mean": np.asarray(mean),
        "std": np.sqrt(variance),
        "count": np.sum([part["count"] for part in parts], axis=0),
    }


def _tasks_table(task: str) -> Any:
    """One row `task_index`, `task`; the note for pandas makes `task` the index, by which LeRobot looks tasks up."""
    import pyarrow

    def column(name: str, kind: str, numpy_type: str) -> dict[str, str | None]:
        types = {"pandas_type": kind, "numpy_type": numpy_type, "metadata": None}
        return {"name": name, "field_name": name} | types

    note = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [column("task_index", "int64", "int64"), column("task", "unicode", "object")],
    }
    table = pyarrow.table({"task_index": pyarrow.array([0], pyarrow.int64()), "task": [task]})
    return table.replace_schema_metadata({"pandas": json.dumps(note)})


def _info(episodes: int, frames: int, rate: Fraction, height: int, width: int) -> dict[str, Any]:
    number: int | float = rate.numerator if rate.denominator == 1 else float(rate)
    video = {
        "video.height": height,
        "video.width": width,
        "video.codec": "h264",
        "video.pix_fmt": "yuv444p",
        "video.is_depth_map": False,
        "video.fps": number,
        "video.channels": 3,
        "has_audio": False,
    }
    camera = {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": video,
    }
    columns = {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in _COLUMNS.items()}
    return {
        "codebase_version": _VERSION,
        "robot_type": None,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": _FILES_PER_CHUNK,
        "data_files_size_in_mb": _DATA_FILE_MB,
        "video_files_size_in_mb": _VIDEO_FILE_MB,
        "fps": number,
        "splits": {"train": f"0:{episodes}"},
        "data_path": _DATA_PATH,
        "video_path": _VIDEO_PATH,
        "features": {CAMERA: camera} | columns,
    }
