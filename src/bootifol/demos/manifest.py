"""What a demo set says about itself: `manifest.json`, read with every field checked."""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, Strict

from bootifol.errors import BootifolError, shortened
from bootifol.files import read_json, write_json
from bootifol.settings import AtLeastTwo, Count, CountOrZero, Flag, Positive, Seed, as_settings

FORMAT = 1
MANIFEST_NAME = "manifest.json"
_PACKAGES = (
    "bootifol",
    "mujoco",
    "dm-control",
    "metaworld",
    "gymnasium",
    "pygame-ce",
    "numpy",
    "pillow",
    "av",
)

_MAY_LACK = (
    "task",
    "seed",
    "agent_size",
    "render_profile",
    "action_repeat",
    "frames_per_second",
    "conversion",
)
"""Fields that a manifest need not have; they are None then."""


@dataclass(frozen=True)
class Shard:
    """One file of videos, `shard-00000.npy`: uint8 `[videos, T + 1, H, W, 3]`."""

    file: str
    videos: Count
    bytes: Annotated[int, Strict(), Field(ge=1)]
    """Size of the whole file, header included."""
    sha256: str
    """Of the whole file, header included."""


@dataclass(frozen=True)
class VideoEntry:
    """One video of the set. Nothing here tells how well the task was done: recordings carry no rewards."""

    name: str
    source: dict[str, Any]
    """Where it comes from: `{"behavior", "seed"}` when recorded, `{"file", "first_frame"}` when imported, with
    `"episode"` and `"camera"` when the file is a LeRobot dataset, `"address"` when it was fetched from a hub, and
    `"notes"` where there was a choice how to read it."""
    length: Count
    """Frames that were seen. A shorter video stands still on its last frame until the set's length."""
    sha256: str
    """Of its pixels `[T + 1, H, W, 3]` in memory order."""

    @property
    def described(self) -> str:
        """The video's name, and for imported ones where to find it."""
        if "file" not in self.source:
            return self.name
        episode = f" episode {self.source['episode']}" if "episode" in self.source else ""
        start = self.source.get("first_frame")
        window = f" from frame {start} on" if start else ""
        return f"{self.name} ({self.source['file']}{episode}{window})"


@dataclass(frozen=True)
class Manifest:
    """The contents of `manifest.json`. There is no date in it: the same recording gives the same bytes."""

    name: str
    """The set's name, from which its videos are named: `<name>-000123`."""
    complete: Flag
    """False while a recording is under way or was interrupted."""
    task: str | None
    """Name in the catalogue of tasks; None for imported videos."""
    behavior: str
    """Who performs: expert, half_good, random, still."""
    seed: Seed | None
    """The seed all videos' seeds derive from; None for imported videos."""
    episodes: Count
    """Videos the complete set has."""
    frames: AtLeastTwo
    """Frames of a video, T + 1."""
    video_size: Count
    """Height and width in pixels of the pictures in this set."""
    agent_size: CountOrZero | None
    """The agent's pictures at recording time. One picture is rendered at the larger of the two sizes and
    resized for the other, so this, too, shows in the pixels."""
    render_profile: str | None
    action_repeat: CountOrZero | None
    frames_per_second: Positive | None
    """Of these videos as time passes in the scene; None when unknown (pictures in a folder)."""
    conversion: dict[str, Any] | None
    """For imported videos, how the files became this set; None when recorded."""
    versions: dict[str, str]
    shards: tuple[Shard, ...]
    videos: tuple[VideoEntry, ...]

    @property
    def video_bytes(self) -> int:
        return self.frames * self.video_size * self.video_size * 3


def installed_versions() -> dict[str, str]:
    """Versions of what decides the pixels of a recording."""
    versions = {}
    for package in _PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return versions


def write_manifest(directory: Path, manifest: Manifest) -> None:
    """Writes `manifest.json` whole or not at all."""
    write_json(directory / MANIFEST_NAME, {"format": FORMAT, **dataclasses.asdict(manifest)}, sealed=True)


def read_manifest(directory: Path) -> Manifest:
    """Reads and checks `manifest.json`, but for its checksum, which `DemoSet.verify` compares.

    Raises:
        BootifolError: it is missing, no JSON, of another format, lacks a field, or contradicts itself.
    """
    path = directory / MANIFEST_NAME
    value = read_json(path, "the demo set's manifest", editable=True)
    if not isinstance(value, dict):
        raise BootifolError(f"{path} is not a demo set's manifest: it should be a JSON object")
    if value.get("format") != FORMAT:
        raise BootifolError(
            f"{path} has format {shortened(value.get('format'))} and this bootifol reads format {FORMAT}: "
            "record the set again, or use the version that wrote it"
        )
    try:
        manifest = as_settings(Manifest, dict.fromkeys(_MAY_LACK) | value)
    except BootifolError as error:
        raise BootifolError(f"{path} is damaged: {error}; record or import the set again") from error
    _check_consistent(path, manifest)
    return manifest


def find_demo_sets(path: Path | str) -> dict[str, Path]:
    """The demo sets at a path, by behavior.

    Args:
        path: a directory of demo sets, one subdirectory a behavior (`DEMOS/expert`, `DEMOS/random`,
            `DEMOS/half_good`: what `bootifol demos record` and `import` write), or one demo set itself.

    Returns:
        Directories by behavior, at least one.

    Raises:
        BootifolError: there is none, or there are two of one behavior.
    """
    path = Path(path)
    found: dict[str, Path] = {}
    for manifest in [*path.glob(MANIFEST_NAME), *sorted(path.glob(f"*/{MANIFEST_NAME}"))]:
        behavior = read_manifest(manifest.parent).behavior
        if behavior in found:
            raise BootifolError(
                f"{found[behavior]} and {manifest.parent} both hold {behavior} videos: move one of them away"
            )
        found[behavior] = manifest.parent
    if not found:
        raise BootifolError(
            f"there is no demo set at {path} (no {MANIFEST_NAME} in it or one directory below): record one "
            f"with `bootifol demos record --task TASK --out {path}`"
        )
    return found


def _check_consistent(path: Path, manifest: Manifest) -> None:
    in_shards = sum(shard.videos for shard in manifest.shards)
    if in_shards != len(manifest.videos):
        raise BootifolError(
            f"{path} contradicts itself: its shards hold {in_shards} videos and it lists "
            f"{len(manifest.videos)}; record or import the set again"
        )
    if manifest.complete and len(manifest.videos) != manifest.episodes:
        raise BootifolError(
            f"{path} contradicts itself: it lists {len(manifest.videos)} videos of {manifest.episodes}; "
            "record or import the set again"
        )
    for video in manifest.videos:
        if video.length > manifest.frames:
            raise BootifolError(
                f"{path} contradicts itself: {video.name} has {video.length} of {manifest.frames} frames; "
                "record or import the set again"
            )
    for shard in manifest.shards:
        if not re.fullmatch(r"shard-\d{5}\.npy", shard.file):
            raise BootifolError(f"{path} names a file that is no shard of its own: {shortened(shard.file)}")
    if len({video.name for video in manifest.videos}) != len(manifest.videos):
        raise BootifolError(f"{path} gives two videos the same name; record or import the set again")
