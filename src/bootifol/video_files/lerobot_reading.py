"""LeRobot datasets on disk, format v3: their videos alone, never their actions or states.

    meta/info.json                              version, frames per second, cameras, path of the videos
    meta/episodes/chunk-000/file-000.parquet    where each episode begins and ends: one row an episode
    videos/<camera>/chunk-000/file-000.mp4      many episodes one after another

Format: https://huggingface.co/docs/lerobot/lerobot-dataset-v3
"""

from __future__ import annotations

import os
import re
import string
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bootifol.errors import BootifolError
from bootifol.files import read_json
from bootifol.video_files.decoding import shown_at, stream_part
from bootifol.video_files.kinds import refuse_stand_in
from bootifol.video_files.litter import is_litter
from bootifol.video_files.orientation import TimedFrame
from bootifol.video_files.reading import is_lerobot_dataset

INFO_PATH = "meta/info.json"
EPISODES_DIRECTORY = "meta/episodes"

OFF_THE_GRID = 0.25
"""Frames by which an episode's beginning may differ from a picture's."""


@dataclass(frozen=True)
class LeRobotEpisode:
    """One episode as one camera saw it: a part of a video file that may hold many episodes."""

    dataset: Path
    camera: str
    """The feature's key, such as `observation.images.front`."""

    index: int
    """Number of the episode in its dataset."""

    file: Path
    first_seconds: float
    """When the episode's first frame appears in the file, as the dataset says; it may drift."""

    length: int
    """Frames of the episode."""

    frames_per_second: float

    position: int = 0
    """Frames of the episodes before this one in its file."""

    frames_of_file: int | None = None
    """Frames of all episodes in its file; None: the file may hold others."""

    def stream(self) -> Iterator[TimedFrame]:
        """The episode's pictures, decoded one by one.

        Raises:
            BootifolError: the file is damaged, or does not hold as many pictures as the dataset promises.
        """
        count = 0
        try:
            refuse_stand_in(self.file)
            for timed in stream_part(self.file, *self._span()):
                count += 1
                yield timed
        except BootifolError as error:
            raise BootifolError(f"episode {self.index} of {self.dataset}: {error}") from error
        if count != self.length:
            raise BootifolError(
                f"episode {self.index} of {self.dataset} should have {self.length} frames and {self.file} holds "
                f"{count} of it: copy or export the dataset again"
            )

    def _span(self) -> tuple[float, float]:
        """From when until before when the episode's pictures appear in the file, in seconds.

        Where the file holds the pictures of its episodes and no others, they are counted. Otherwise the dataset's times
        must be those of the file's pictures.
        """
        half_a_frame = 0.5 / self.frames_per_second
        shown = shown_at(self.file)
        first = self.position
        if len(shown) != self.frames_of_file:
            nearest = int(np.abs(np.array(shown) - self.first_seconds).argmin()) if shown else 0
            if not shown or self.first_seconds > shown[-1] + half_a_frame:
                return self.first_seconds, self.first_seconds
            off = abs(shown[nearest] - self.first_seconds) * self.frames_per_second
            if off > OFF_THE_GRID:
                raise BootifolError(
                    f"it should begin at {self.first_seconds:.3f} s of {self.file}, where no picture begins (the "
                    f"nearest is at {shown[nearest]:.3f} s), and the file holds {len(shown)} pictures where its "
                    f"episodes have {self.frames_of_file}: export the dataset again"
                )
            first = nearest
        last = first + self.length
        end = shown[last] - half_a_frame / 2 if last < len(shown) else shown[-1] + half_a_frame
        return shown[first] - half_a_frame / 2, end


def lerobot_episodes(dataset: Path, camera: str | None = None) -> list[LeRobotEpisode]:
    """All episodes of a dataset, in order.

    Args:
        dataset: its directory.
        camera: key of the camera; it must be given when there are several.

    Raises:
        BootifolError: the format is another version's, something is missing or damaged, or the camera is unclear.
    """
    info = _read_info(dataset)
    camera = _chosen_camera(dataset, info, camera)
    rate = _number(info.get("fps"), dataset / INFO_PATH, "fps")
    if rate <= 0:
        raise BootifolError(f"{dataset / INFO_PATH} is damaged: fps is {rate:g}; copy the dataset again")
    rows = sorted(_read_rows(dataset, camera), key=lambda row: row.number("episode_index"))
    episodes = [_episode(dataset, info, camera, rate, row) for row in rows]
    promised = info.get("total_episodes")
    if [episode.index for episode in episodes] != list(range(len(episodes))) or promised != len(episodes):
        raise BootifolError(
            f"{dataset / EPISODES_DIRECTORY} lists {len(episodes)} episodes and {INFO_PATH} promises "
            f"{promised}, numbered from 0: copy or download the whole dataset again"
        )
    if not episodes:
        raise BootifolError(f"{dataset} holds no episodes: record some with LeRobot first")
    for file in sorted({episode.file for episode in episodes}):
        if not file.is_file():
            missing = [episode.index for episode in episodes if episode.file == file]
            raise BootifolError(
                f"{file} is missing, and with it {len(missing)} episodes from number {missing[0]} on: copy or "
                "download the whole dataset again"
            )
    return _placed(episodes)


def _placed(episodes: list[LeRobotEpisode]) -> list[LeRobotEpisode]:
    """The episodes with their positions in their files, in which they lie in order."""
    placed: dict[int, LeRobotEpisode] = {}
    files: dict[Path, list[LeRobotEpisode]] = defaultdict(list)
    for episode in episodes:
        files[episode.file].append(episode)
    for inside in files.values():
        total = sum(episode.length for episode in inside)
        position = 0
        for episode in sorted(inside, key=lambda episode: (episode.first_seconds, episode.index)):
            placed[episode.index] = replace(episode, position=position, frames_of_file=total)
            position += episode.length
    return [placed[episode.index] for episode in episodes]


def parquet_library() -> Any:
    """The module `pyarrow.parquet`, which is installed on demand only.

    Raises:
        BootifolError: pyarrow is not installed.
    """
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise BootifolError(
            "LeRobot datasets keep their tables in parquet files, for which pyarrow is missing: install it with "
            "`pip install pyarrow`, or bootifol with its extra `lerobot`"
        ) from error
    return pyarrow.parquet


def _read_info(dataset: Path) -> dict[str, Any]:
    if not is_lerobot_dataset(dataset):
        raise BootifolError(f"{dataset} is no LeRobot dataset: there is no {INFO_PATH} in it")
    refuse_stand_in(dataset / INFO_PATH)
    info = read_json(dataset / INFO_PATH, "the LeRobot dataset's description")
    version = info.get("codebase_version") if isinstance(info, dict) else None
    if not isinstance(version, str):
        raise BootifolError(
            f"{dataset / INFO_PATH} names no codebase_version: {dataset} is no LeRobot dataset, or a damaged one"
        )
    if version.split(".")[0] != "v3":
        raise BootifolError(
            f"{dataset} is a LeRobot dataset of format {version} and bootifol reads v3.0: convert it with "
            f"LeRobot's `python -m lerobot.scripts.convert_dataset_v21_to_v30 --repo-id NAME --root {dataset}`"
        )
    if info.get("storage_format") not in (None, "default"):
        raise BootifolError(
            f"{dataset} is stored as {info['storage_format']!r} and bootifol reads LeRobot's parquet and mp4 "
            "files: take the dataset in its default format"
        )
    assert isinstance(info, dict)
    return info


def _chosen_camera(dataset: Path, info: dict[str, Any], camera: str | None) -> str:
    features = info.get("features")
    if not isinstance(features, dict) or not all(isinstance(value, dict) for value in features.values()):
        raise BootifolError(f"{dataset / INFO_PATH} is damaged: it has no features; copy the dataset again")
    cameras: list[str] = [
        key for key, value in features.items() if value.get("dtype") == "video" and not _shows_depth(value)
    ]
    if camera is not None and camera in cameras:
        return camera
    if not cameras:
        raise BootifolError(
            f"{dataset} has no color videos (its features: {', '.join(features)}): bootifol learns from videos "
            "alone, so record or convert the dataset with videos"
        )
    listed = ", ".join(cameras)
    if camera is not None:
        raise BootifolError(f"{dataset} has no camera {camera!r}; choose among {listed}")
    if len(cameras) > 1:
        raise BootifolError(f"{dataset} has {len(cameras)} cameras: choose one with --camera, among {listed}")
    return cameras[0]


def _shows_depth(feature: dict[str, Any]) -> bool:
    """Whether a video's pixels are distances; older files say it under another name."""
    described = [feature.get("info"), feature.get("video_info")]
    return any(
        bool(info.get("is_depth_map") or info.get("video.is_depth_map"))
        for info in described
        if isinstance(info, dict)
    )


@dataclass(frozen=True)
class _Row:
    """One episode in a parquet file, with errors that name the file and the column."""

    file: Path
    values: dict[str, Any]

    def number(self, column: str) -> int:
        value = self.values[column]
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise _damaged(self.file, column, value)
        return value

    def seconds(self, column: str) -> float:
        return _number(self.values[column], self.file, column)


def _read_rows(dataset: Path, camera: str) -> list[_Row]:
    parquet = parquet_library()
    import pyarrow

    files = sorted(
        file
        for file in (dataset / EPISODES_DIRECTORY).glob("*/*.parquet")
        if file.is_file() and not is_litter(file)
    )
    if not files:
        raise BootifolError(
            f"{dataset / EPISODES_DIRECTORY} holds no parquet files, which say where each episode begins: copy or "
            "download the whole dataset again"
        )
    columns = [
        "episode_index",
        "length",
        *(
            f"videos/{camera}/{name}"
            for name in ("chunk_index", "file_index", "from_timestamp", "to_timestamp")
        ),
    ]
    rows = []
    for file in files:
        refuse_stand_in(file)
        try:
            table = parquet.ParquetFile(file).read(use_threads=False)
            missing = [column for column in columns if column not in table.column_names]
            if missing:
                raise BootifolError(
                    f"{file} has no column {', '.join(missing)}: copy or download the whole dataset again"
                )
            rows += [_Row(file, values) for values in table.select(columns).to_pylist()]
        except (pyarrow.ArrowException, OSError, ValueError, LookupError) as error:
            raise BootifolError(f"{file} is damaged or no parquet file ({error}): copy it again") from error
    return rows


def _episode(dataset: Path, info: dict[str, Any], camera: str, rate: float, row: _Row) -> LeRobotEpisode:
    index, length = row.number("episode_index"), row.number("length")
    begins = row.seconds(f"videos/{camera}/from_timestamp")
    ends = row.seconds(f"videos/{camera}/to_timestamp")
    # Players' durations may count a frame more or less.
    if length < 1 or begins < 0 or abs((ends - begins) * rate - length) > 1.5:
        raise BootifolError(
            f"{row.file} contradicts itself: episode {index} has {length} frames and lasts from {begins:.3f} to "
            f"{ends:.3f} s at {rate:g} a second; copy or download the dataset again"
        )
    file = _video_file(
        dataset,
        info,
        video_key=camera,
        chunk_index=row.number(f"videos/{camera}/chunk_index"),
        file_index=row.number(f"videos/{camera}/file_index"),
    )
    return LeRobotEpisode(dataset, camera, index, file, begins, length, rate)


def _video_file(dataset: Path, info: dict[str, Any], **fields: str | int) -> Path:
    template = info.get("video_path")
    try:
        if not _is_harmless(str(template)):
            raise ValueError
        relative = os.path.normpath(str(template).format(**fields))
    except (ValueError, LookupError, AttributeError) as error:
        raise _damaged(dataset / INFO_PATH, "video_path", template) from error
    # Not Path.resolve: downloaded datasets link to files elsewhere, but no template may lead there.
    unfit = Path(relative).is_absolute() or relative.startswith("..") or len(relative) > 1000
    if not isinstance(template, str) or unfit:
        raise _damaged(dataset / INFO_PATH, "video_path", template)
    return dataset / relative


def _is_harmless(template: str) -> bool:
    """Whether a template has plain fields, numbers no wider than `06d`: a width of 10^9 would be a text of as many."""
    fields = [(name, spec) for _, name, spec, _ in string.Formatter().parse(template) if name is not None]
    return len(template) <= 1000 and all(
        name.isidentifier() and re.fullmatch(r"(0?\d?\d?d)?", spec or "") for name, spec in fields
    )


def _number(value: Any, file: Path, what: str) -> float:
    # The bound refuses NaN and infinity, too.
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < 1e9:
        raise _damaged(file, what, value)
    return float(value)


def _damaged(file: Path, what: str, value: Any) -> BootifolError:
    return BootifolError(f"{file} is damaged: {what} is {value!r}; copy or download the whole dataset again")
