"""People's own video files become a demo set: one frame rate, length and size, all of it written down."""

from __future__ import annotations

import dataclasses
import math
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bootifol.demos.contact_sheet import write_contact_sheet
from bootifol.demos.demo_set import DemoSet, listed
from bootifol.demos.manifest import Manifest, Shard, VideoEntry, installed_versions, write_manifest
from bootifol.demos.shards import (
    last_frame_held,
    sha256_of_frames,
    videos_per_shard,
    write_shard,
)
from bootifol.envs.pictures import centered_square, resize
from bootifol.errors import BootifolError, BootifolWarning, collected_warnings, warn
from bootifol.files import remove_leftovers, written_aside
from bootifol.hub import fetched_folder, hub_address, is_hub_address
from bootifol.locks import one_writer
from bootifol.progress import progress
from bootifol.types import Frame, Frames
from bootifol.video_files.kinds import PICTURE_SUFFIXES, VIDEO_SUFFIXES
from bootifol.video_files.lerobot_reading import LeRobotEpisode, lerobot_episodes
from bootifol.video_files.orientation import TimedFrame
from bootifol.video_files.reading import frame_rate, is_lerobot_dataset, stream_video, video_paths

Source = Path | LeRobotEpisode
"""One recording: a file, a folder of pictures, or one episode of a LeRobot dataset."""

Crop = tuple[int, int, int]
"""A square of a picture: its left edge, its top edge and its side, in pixels."""

LONGEST_STILL = 20_000
"""Times that one picture of a file is taken in a row, at most: thirteen minutes at 25 a second. Damaged time stamps ask
for any number."""

READ_SUFFIXES = (*sorted(VIDEO_SUFFIXES | PICTURE_SUFFIXES), ".npy", ".npz")
"""Of files that are fetched from a hub."""

LEROBOT_TABLES = ("meta",)
"""Folders of a LeRobot dataset that say what its videos are; those with actions stay where they are."""

LARGEST_SQUARE = "largest centered square"
"""How a manifest names the crop that nobody chose."""


@dataclass(frozen=True)
class Conversion:
    """How video files become videos of one length and size."""

    frames: int = 61
    """Frames of every video in the set, T + 1; make it the task's agent steps per episode plus 1."""

    size: int = 64
    """Height and width of the pictures in pixels, to which the square that is cut out is resized."""

    crop: Crop | None = None
    """The square to cut out of every upright picture; by default the largest centered one."""

    frames_per_second: float | None = None
    """Pictures per second to resample to (the picture showing at each instant); None keeps every picture."""

    windows: Literal["all", "first"] = "all"
    """`all` cuts a long file into one video after another and drops an unfinished last one; `first` takes
    its beginning only. A file shorter than one video stands still on its last picture."""

    def __post_init__(self) -> None:
        if self.frames < 2:
            raise BootifolError(f"a video needs at least 2 frames, not {self.frames}")
        if not 1 <= self.size <= 1024:
            raise BootifolError(f"pictures need a size of at least 1 pixel and at most 1024, not {self.size}")
        if self.crop is not None and (min(self.crop[:2]) < 0 or self.crop[2] < 1):
            raise BootifolError(
                "a crop is LEFT TOP SIDE in pixels, edges of at least 0 and a side of at least 1, not "
                + " ".join(map(str, self.crop))
            )
        if self.frames_per_second is not None and not 0 < self.frames_per_second <= 1000:
            raise BootifolError(
                f"frames per second must be above 0 and at most 1000, not {self.frames_per_second}"
            )


def import_videos(
    files: Sequence[Path | str],
    out: Path | str,
    conversion: Conversion | None = None,
    behavior: str = "expert",
    name: str | None = None,
    camera: str | None = None,
) -> DemoSet:
    """Writes a demo set from video files; the set appears whole or not at all.

    Args:
        files: video files, folders of them or of the pictures of one video, .npy and .npz arrays, and LeRobot
            datasets (each episode one video), as `video_paths` finds them; and addresses `hf://datasets/USER/NAME`
            of the Hugging Face hub, of which what is such a file is fetched (the extra `hub`).
        out: directory of the set; it must not exist.
        conversion: frame rate, length and size of the result.
        behavior: what the videos show.
        name: of the set; `<directory above>-<behavior>` by default.
        camera: which camera of LeRobot datasets to take; needed where they have several.

    Raises:
        BootifolError: `out` exists, files are empty, damaged or truncated (all such files are named), or the
            camera is unclear. What was left out, or taken one way where another was possible, is a `BootifolWarning`,
            and stands in the manifest beside the file.
    """
    conversion = conversion or Conversion()
    out = Path(out)
    if out.exists():
        raise BootifolError(f"{out} exists already: choose another directory or remove it")
    if not files:
        raise BootifolError("there are no videos to import: name files, or folders of pictures")
    name = name or f"{out.resolve().parent.name}-{behavior}"
    fetched = _fetched(files)
    sources = _sources(video_paths([fetched.get(file, Path(file)) for file in files]), camera)
    origins = {folder: str(hub_address(file)) for file, folder in fetched.items()}
    with one_writer(out, out.parent / f".{out.name}.lock"):
        remove_leftovers(out.parent, out)
        if out.exists():
            raise BootifolError(f"{out} exists by now: another process has imported videos there")
        with written_aside(out) as aside:
            aside.mkdir()
            _write_set(aside, sources, conversion, behavior, name, origins)
            write_contact_sheet(aside, DemoSet.open(aside))
    return DemoSet.open(out)


def _fetched(files: Sequence[Path | str]) -> dict[Path | str, Path]:
    """Where what has an address of the Hugging Face hub lies on this machine."""
    return {
        file: fetched_folder(hub_address(file), READ_SUFFIXES, LEROBOT_TABLES)
        for file in files
        if is_hub_address(file)
    }


def read_recordings(
    path: Path,
    size: int,
    frames_per_second: float | None,
    camera: str | None = None,
    crop: Crop | None = None,
) -> Iterator[tuple[str, Frames]]:
    """Videos as an import would show them, but each in one piece and nothing written.

    Args:
        path: as of `import_videos`.
        size: height and width of the result.
        frames_per_second: to resample to, where a file says how fast it plays; None keeps every picture.
        camera: of a LeRobot dataset.
        crop: as of `Conversion`.

    Yields:
        A name, and uint8 `[n, size, size, 3]`.

    Raises:
        BootifolError: as `import_videos`.
    """
    for source in _sources(video_paths([path]), camera if is_lerobot_dataset(path) else None):
        rate = frames_per_second if _rate(source) else None
        name = f"{path} episode {source.index}" if isinstance(source, LeRobotEpisode) else str(source)
        for frames in convert(source, Conversion(sys.maxsize, size, crop, rate)):
            yield name, frames


def convert(source: Source, conversion: Conversion) -> Iterator[Frames]:
    """The windows of one recording, uint8 `[n, size, size, 3]`; only the last may have `n` below `frames`.

    Raises:
        BootifolError: it cannot be read to its end, has no times to resample by, or is smaller than its crop.
    """
    window: list[Frame] = []
    windows = 0
    for frame in _resampled(source, conversion.frames_per_second):
        if conversion.windows == "first" and windows:
            continue  # still read to the end, so that a truncated file is noticed
        window.append(_square(frame, conversion, source))
        if len(window) == conversion.frames:
            yield np.stack(window)
            windows += 1
            window = []
    if window and not windows:
        yield np.stack(window)


def _square(frame: Frame, conversion: Conversion, source: Source) -> Frame:
    if conversion.crop is None:
        return centered_square(frame, conversion.size)
    left, top, side = conversion.crop
    height, width, _ = frame.shape
    if left + side > width or top + side > height:
        raise BootifolError(
            f"{source}: a crop of {side}×{side} pixels at {left}, {top} reaches out of its pictures, which have "
            f"{width}×{height} (width × height, upright)"
        )
    return resize(frame[top : top + side, left : left + side], conversion.size)


def _sources(files: Sequence[Path], camera: str | None) -> list[Source]:
    """The recordings in these files: a LeRobot dataset stands for its episodes."""
    if camera is not None and not any(is_lerobot_dataset(file) for file in files):
        raise BootifolError(
            f"there is no camera {camera!r} to choose: only LeRobot datasets (directories with meta/info.json) "
            "have cameras by name"
        )
    sources: list[Source] = []
    for file in files:
        sources += lerobot_episodes(file, camera) if is_lerobot_dataset(file) else [file]
    return sources


def _stream(source: Source) -> Iterator[TimedFrame]:
    return source.stream() if isinstance(source, LeRobotEpisode) else stream_video(source)


def _rate(source: Source) -> float | None:
    return source.frames_per_second if isinstance(source, LeRobotEpisode) else frame_rate(source)


def _described(source: Source, origins: Mapping[Path, str]) -> dict[str, Any]:
    """Where a recording comes from, for the manifest; `origins` are the addresses of what was fetched."""
    place = source.dataset if isinstance(source, LeRobotEpisode) else source
    addresses = [address for folder, address in origins.items() if place.is_relative_to(folder)]
    address = {"address": addresses[0]} if addresses else {}
    if isinstance(source, LeRobotEpisode):
        # A fetched data set lies in a folder that is named after its commit.
        name = addresses[0].rpartition("/")[2] if addresses else source.dataset.resolve().name
        return {"file": name, "episode": source.index, "camera": source.camera} | address
    return {"file": source.name} | address


def _resampled(source: Source, frames_per_second: float | None) -> Iterator[Frame]:
    """The pictures showing at 0, 1/fps, 2/fps … seconds; every picture when no rate is asked for."""
    if frames_per_second is None:
        yield from (timed.frame for timed in _stream(source))
        return
    showing: TimedFrame | None = None
    since = gap = 0.0
    emitted = 0
    for timed in _stream(source):
        seconds = _seconds(source, timed)
        if showing is not None:
            gap = seconds - since
            if gap < 0:
                raise BootifolError(
                    f"{source}: its times run backward at {since:.2f} s, so nobody can say which picture shows when: "
                    "import it without --fps, which keeps every picture, or save it anew with another program"
                )
            instants = _instants_before(source, seconds, gap, timed.tick, frames_per_second)
            for _ in range(emitted, instants):
                yield showing.frame
                emitted += 1
        showing, since = timed, seconds
    if showing is not None:
        # Where the file does not say, the last picture shows as long as the one before it did.
        lasts = gap if showing.lasts is None else showing.lasts
        instants = max(1, _instants_before(source, since + lasts, lasts, showing.tick, frames_per_second))
        # At a file's own rate a duration that is a tick too short must not lose the picture.
        own_rate = showing.tick > 0 and lasts * frames_per_second > 0.75
        if own_rate and emitted / frames_per_second < since + lasts + showing.tick:
            instants = max(instants, emitted + 1)
        for _ in range(emitted, instants):
            yield showing.frame


def _instants_before(source: Source, seconds: float, gap: float, tick: float, rate: float) -> int:
    """How many of 0, 1/fps, 2/fps … lie before a time, up to what rounded time stamps are off by.

    Args:
        source: for the sentence.
        seconds: the time.
        gap: how long a picture has shown until then.
        tick: what the file's times are off by.
        rate: fps.
    """
    if gap * rate > LONGEST_STILL:
        raise BootifolError(
            f"{source} shows one picture for {gap:,.0f} s, {rate:g} times a second: its times are damaged, or the rate "
            "is too high; trim it or export it again, or import it without --fps"
        )
    tolerance = min(max(tick, 0.0005), 0.4 * gap)
    return max(0, math.ceil((seconds - tolerance) * rate))


def _seconds(source: Source, timed: TimedFrame) -> float:
    if timed.seconds is None:
        raise BootifolError(
            f"{source} has no times to resample by (pictures, arrays and raw streams have none): import it without "
            "--fps, and with --frames instead of --task"
        )
    return timed.seconds


def _tell(notes: Sequence[BootifolWarning]) -> None:
    """Says once what is true of many files."""
    files: dict[str, list[str]] = defaultdict(list)
    for note in notes:
        files[note.what].append(str(note.where))
    for what, where in files.items():
        warn(f"{listed(where)}: {what}")


def _write_set(
    directory: Path,
    sources: Sequence[Source],
    conversion: Conversion,
    behavior: str,
    name: str,
    origins: Mapping[Path, str],
) -> None:
    video_bytes = conversion.frames * conversion.size**2 * 3
    per_shard = videos_per_shard(None, video_bytes)
    shards: list[Shard] = []
    entries: list[VideoEntry] = []
    waiting: list[Frames] = []
    problems: list[str] = []
    notes: list[BootifolWarning] = []
    with progress("importing", total=len(sources)) as advance:
        for source in sources:
            before = len(entries)
            with collected_warnings() as told:
                try:
                    for window, frames in enumerate(convert(source, conversion)):
                        padded = last_frame_held(frames, conversion.frames)
                        entries.append(
                            VideoEntry(
                                name=f"{name}-{len(entries):06d}",
                                source=_described(source, origins)
                                | {"first_frame": window * conversion.frames},
                                length=len(frames),
                                sha256=sha256_of_frames(padded),
                            )
                        )
                        waiting.append(padded)
                        if len(waiting) == per_shard:
                            shards.append(write_shard(directory, len(shards), np.stack(waiting)))
                            waiting = []
                except BootifolError as error:
                    problems.append(str(error))
            if told:
                for entry in entries[before:]:
                    entry.source["notes"] = [note.what for note in told]
            notes += told
            advance(videos=str(len(entries)))
    _tell(notes)
    if problems:
        raise BootifolError("\n".join(problems))
    if waiting:
        shards.append(write_shard(directory, len(shards), np.stack(waiting)))
    rates = {conversion.frames_per_second} if conversion.frames_per_second else set(map(_rate, sources))
    write_manifest(
        directory,
        Manifest(
            name=name,
            complete=True,
            task=None,
            behavior=behavior,
            seed=None,
            episodes=len(entries),
            frames=conversion.frames,
            video_size=conversion.size,
            agent_size=None,
            render_profile=None,
            action_repeat=None,
            frames_per_second=rates.pop() if len(rates) == 1 else None,
            conversion=dataclasses.asdict(conversion)
            | {"crop": list(conversion.crop) if conversion.crop else LARGEST_SQUARE},
            versions=installed_versions(),
            shards=tuple(shards),
            videos=tuple(entries),
        ),
    )
