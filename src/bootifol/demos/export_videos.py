"""A demo set's videos as files that other programs read: mp4, numpy arrays, a LeRobot dataset."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import find_demo_sets
from bootifol.demos.shards import sha256_of_frames
from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.progress import progress
from bootifol.types import Frames
from bootifol.video_files.lerobot_reading import parquet_library
from bootifol.video_files.lerobot_writing import write_lerobot
from bootifol.video_files.writing import exact_rate, write_video

Format = Literal["mp4", "npy", "lerobot"]


def export_videos(
    demos: Path | str,
    out: Path | str,
    format: Format = "mp4",
    behavior: str = "expert",
    frames_per_second: float | None = None,
    videos: int | None = None,
) -> int:
    """Writes a demo set's videos, each as long as it was seen; the directory appears whole or not at all.

    Args:
        demos: directory of the demo sets, or one of them.
        out: directory to write; it must not exist.
        format: `mp4`, one a video (small pictures are enlarged, see `write_video`); `npy`, one array
            uint8 `[n, H, W, 3]` a video; `lerobot`, one dataset of format v3.
        behavior: which of the sets.
        frames_per_second: playing speed, that of the set by default; arrays have none.
        videos: how many, from the first on; all by default.

    Returns:
        The number of videos written.

    Raises:
        BootifolError: there is no such set, it is damaged, its frame rate is unknown and not given, or `out`
            exists or cannot be written.
    """
    out = Path(out)
    if out.exists():
        raise BootifolError(f"{out} exists already: choose another directory or remove it")
    if videos is not None and videos < 1:
        raise BootifolError(f"at least 1 video must be exported, not {videos}")
    demo_set = _set_of(demos, behavior)
    manifest = demo_set.manifest
    count = len(demo_set) if videos is None else min(videos, len(demo_set))
    rate = frames_per_second if frames_per_second is not None else manifest.frames_per_second
    if format != "npy":
        if rate is None:
            raise BootifolError(
                f"{demo_set.path} does not say how fast its videos play (they came from pictures or arrays): give "
                "--fps, in pictures a second"
            )
        exact_rate(rate)
    if format == "lerobot":
        parquet_library()
    with progress(f"exporting {manifest.name}", total=count) as advance, written_aside(out) as aside:
        aside.mkdir()
        if format == "lerobot":
            assert rate is not None
            seen = (frames for _, frames in _seen_frames(demo_set, count))
            write_lerobot(aside, seen, rate, manifest.task or manifest.name, advance)
            return count
        for name, frames in _seen_frames(demo_set, count):
            if format == "npy":
                np.save(aside / f"{name}.npy", frames, allow_pickle=False)
            else:
                assert rate is not None
                write_video(aside / f"{name}.mp4", frames, rate)
            advance()
    return count


def _set_of(demos: Path | str, behavior: str) -> DemoSet:
    found = find_demo_sets(demos)
    if behavior not in found:
        raise BootifolError(
            f"{demos} holds no {behavior} videos: choose among --behavior {', '.join(sorted(found))}"
        )
    return DemoSet.open(found[behavior])


def _seen_frames(demo_set: DemoSet, count: int) -> Iterator[tuple[str, Frames]]:
    """Names and frames of the first `count` videos, without the repetitions that fill a short video up."""
    for index in range(count):
        entry, video = demo_set.manifest.videos[index], demo_set[index]
        if sha256_of_frames(video.frames) != entry.sha256:
            raise BootifolError(
                f"{demo_set.path} is damaged: the pixels of {entry.name} are not the ones recorded; restore its "
                "files or record the set again"
            )
        if Path(entry.name).name != entry.name or entry.name.startswith("."):
            raise BootifolError(
                f"{demo_set.path} has a video named {entry.name!r}, which is no file name: import the set again"
            )
        yield entry.name, video.frames[: entry.length]
