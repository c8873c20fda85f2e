"""Is a demo set whole, are its videos worth learning from, and do they fit the task?"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bootifol.demos.contact_sheet import write_contact_sheet
from bootifol.demos.demo_set import DemoSet, listed
from bootifol.demos.fit import differences, shown_like
from bootifol.demos.manifest import Manifest, VideoEntry
from bootifol.demos.near_duplicates import near_duplicates
from bootifol.demos.scene_match import (
    FIRST_FRAMES_NAME,
    differences_of_looks,
    first_frames,
    write_first_frames,
)
from bootifol.demos.video_statistics import VideoStatistics, statistics_of
from bootifol.envs.pictures import PictureConfig
from bootifol.progress import progress
from bootifol.tasks import Task

LONG_STILLNESS = 0.5
"""Fraction of a video that may pass without motion before something moves. In recorded experts it is at most 0.2."""

USUAL_STILLNESS = 0.25
"""Where half of the videos stand still at their end for less than this, one that does for `LONG_STILLNESS` is odd. An
expert that holds its goal stands still for two thirds of every video, and that is no fault."""

FEW_GROUPS = 3
"""Groups of nearly the same videos that get a sentence each; more are one sentence."""

LITTLE_MOTION = 0.007
"""Fraction of the picture that changes in a step below which a task is hard to see: 29 pixels of 64×64. The catalogue's
experts change 72 or more; Reacher-v5 through its own camera 11, from which no action could be inferred."""


@dataclass(frozen=True)
class Defects:
    """Videos that may not be worth learning from, by name (with the file they come from, when imported)."""

    duplicates: tuple[tuple[str, ...], ...] = ()
    """Equal to the last pixel, in groups."""
    near_duplicates: tuple[tuple[str, ...], ...] = ()
    """Showing the same, in groups, though some pixels differ."""
    frozen: tuple[str, ...] = ()
    """Showing one picture throughout."""
    half_frozen: tuple[str, ...] = ()
    """Showing one picture for more than half of their length."""
    blank: tuple[str, ...] = ()
    """With pictures that are black, white or of any one color."""
    cut: tuple[str, ...] = ()
    """Going over to another scene, and the frame where they do."""
    little_motion: float | None = None
    """Fraction of the picture that changes in a step of most videos, where that is too little to learn from."""

    def sentences(self) -> list[str]:
        """One sentence a defect, with what to do."""
        found = [
            f"the same video {len(names)} times: {listed(names)}; keep one of them"
            for names in self.duplicates
        ]
        if len(self.near_duplicates) <= FEW_GROUPS:
            found += [
                f"nearly the same video {len(names)} times (compressed again?): {listed(names)}; keep one of them"
                for names in self.near_duplicates
            ]
        else:
            alike = [name for names in self.near_duplicates for name in names]
            found.append(
                f"{len(alike)} videos look nearly like another, in {len(self.near_duplicates)} groups: keep one of "
                f"each if they were compressed again; no fault where starts differ little. They are {listed(alike)}"
            )
        advice = {
            "nothing moves in {}: leave them out, unless the task is to keep still": self.frozen,
            "nothing moves for more than half of {}: trim the waiting before you import": self.half_frozen,
            "some pictures are black, white or of one color in {}: trim fades and title pages": self.blank,
            "the whole picture changes at once in {}: split the file at the cut, one scene a file": self.cut,
        }
        found += [sentence.format(listed(names)) for sentence, names in advice.items() if names]
        if self.little_motion is not None:
            found.append(
                f"only {self.little_motion:.1%} of the picture changes in a step: let the task fill it, with the "
                "camera closer or the videos cropped, and the environment shown the same way; if motions are slow, "
                "take fewer pictures a second"
            )
        return found


@dataclass(frozen=True)
class CheckedSet:
    """What was found in a demo set whose every checksum agrees."""

    manifest: Manifest
    bytes_on_disk: int
    defects: Defects
    differences: tuple[str, ...]
    """How the set differs from the task, each with what to do; empty without a task."""
    looks_differ: bool
    """Whether any of the differences is of light, color or place."""
    contact_sheet: Path
    first_frames: Path | None
    """First frames of videos and environment; None without a task, or when the videos show another one."""


def check_demo_set(path: Path, task: Task | None = None) -> CheckedSet:
    """Reads every byte of a demo set, compares every checksum and looks at every video.

    Args:
        path: directory of one demo set; `contact_sheet.png` is written into it, and `first_frames.png` with a task.
        task: to compare with.

    Raises:
        BootifolError: the set is unfinished, incomplete or damaged; names the file and the videos.
    """
    demo_set = DemoSet.open(path, verify=True)
    manifest = demo_set.manifest
    looks = _look_at_all(demo_set)
    found = differences(manifest, task) if task is not None else []
    picture = None
    looks_of_videos: list[str] = []
    if task is not None and manifest.task in (None, task.name):
        videos = np.stack([video.first for video in looks])
        pictures = PictureConfig()
        environment = first_frames(task, replace(pictures, **shown_like(manifest, pictures)))
        picture = write_first_frames(path, videos, environment)
        looks_of_videos = differences_of_looks(videos, environment, path / FIRST_FRAMES_NAME)
    return CheckedSet(
        manifest=manifest,
        bytes_on_disk=sum(shard.bytes for shard in manifest.shards),
        defects=find_defects(manifest, looks),
        differences=(*found, *looks_of_videos),
        looks_differ=bool(looks_of_videos),
        contact_sheet=write_contact_sheet(path, demo_set),
        first_frames=picture,
    )


def find_defects(manifest: Manifest, looks: Sequence[VideoStatistics]) -> Defects:
    """What is wrong with single videos; those of nobody acting, or of a half-good one, may stand still.

    Args:
        manifest: of the demo set.
        looks: of its videos, in its order.
    """
    entries = manifest.videos
    by_pixels: dict[str, list[int]] = defaultdict(list)
    for index, entry in enumerate(entries):
        by_pixels[entry.sha256].append(index)
    frozen = [index for index, video in enumerate(looks) if video.still_at_end == 1.0]
    # Of equal videos one is compared with the others, and videos without motion are named already.
    compared = sorted({indices[0] for indices in by_pixels.values()} - set(frozen))
    near = near_duplicates(np.stack([looks[index].digest for index in compared])) if compared else []
    usually = float(np.median([video.still_at_end for video in looks])) < USUAL_STILLNESS
    half_frozen = [
        index
        for index, video in enumerate(looks)
        if video.still_before_motion > LONG_STILLNESS
        or (usually and 1.0 > video.still_at_end > LONG_STILLNESS)
    ]
    still = manifest.behavior == "still"
    motions = [video.moving_pixels for index, video in enumerate(looks) if index not in frozen]
    motion = float(np.median(motions)) if motions and manifest.behavior == "expert" else 1.0
    return Defects(
        duplicates=tuple(_named(entries, indices) for indices in by_pixels.values() if len(indices) > 1),
        near_duplicates=tuple(_named(entries, [compared[place] for place in group]) for group in near),
        frozen=() if still else _named(entries, frozen),
        half_frozen=() if still or manifest.behavior == "half_good" else _named(entries, half_frozen),
        blank=_named(entries, [index for index, video in enumerate(looks) if video.blank]),
        cut=tuple(
            f"{entry.described} at frame {video.cut}"
            for entry, video in zip(entries, looks, strict=True)
            if video.cut is not None
        ),
        little_motion=motion if motion < LITTLE_MOTION else None,
    )


def _look_at_all(demo_set: DemoSet) -> list[VideoStatistics]:
    looks = []
    with progress(f"looking at {demo_set.manifest.name}", total=len(demo_set)) as advance:
        for index, entry in enumerate(demo_set.manifest.videos):
            looks.append(statistics_of(demo_set[index].frames[: entry.length]))
            advance()
    return looks


def _named(entries: Sequence[VideoEntry], indices: Sequence[int]) -> tuple[str, ...]:
    return tuple(entries[index].described for index in indices)
