"""Is a demo set whole, are its videos worth learning from, and do they fit the task?"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

from bootifol.demos.contact_sheet import write_contact_sheet
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import Manifest
from bootifol.envs.pictures import PictureConfig
from bootifol.tasks import Task, make_environment


@dataclass(frozen=True)
class CheckedSet:
    """What was found in a demo set whose every checksum agrees."""

    manifest: Manifest
    bytes_on_disk: int
    duplicates: tuple[tuple[str, ...], ...]
    """Names of videos that are equal to the last pixel, in groups."""
    frozen: tuple[str, ...]
    """Names of videos that show one picture throughout."""
    differences: tuple[str, ...]
    """How the set differs from the task, each with what to do; empty without a task."""
    contact_sheet: Path


def check_demo_set(path: Path, task: Task | None = None) -> CheckedSet:
    """Reads every byte of a demo set, compares every checksum and looks at every video.

    Args:
        path: directory of one demo set; `contact_sheet.png` is written into it.
        task: to compare with.

    Raises:
        BootifolError: the set is unfinished, incomplete or damaged; names the file and the videos.
    """
    demo_set = DemoSet.open(path, verify=True)
    manifest = demo_set.manifest
    by_pixels: dict[str, list[str]] = defaultdict(list)
    for entry in manifest.videos:
        by_pixels[entry.sha256].append(entry.name)
    videos = (demo_set[index] for index in range(len(demo_set)))
    return CheckedSet(
        manifest=manifest,
        bytes_on_disk=sum(shard.bytes for shard in manifest.shards),
        duplicates=tuple(tuple(names) for names in by_pixels.values() if len(names) > 1),
        frozen=tuple(video.name for video in videos if (video.frames == video.frames[0]).all()),
        differences=tuple(differences(manifest, task)) if task is not None else (),
        contact_sheet=write_contact_sheet(path, demo_set),
    )


def differences(manifest: Manifest, task: Task, pictures: PictureConfig | None = None) -> list[str]:
    """How videos differ from what a run of the task would see, one sentence each, with what to do about it.

    The reward compares the agent's pictures with these videos, so any difference that is not the agent's doing
    may pass for skill or the lack of it.

    Args:
        manifest: of the demo set.
        task: what the run performs.
        pictures: how the run shows the environment; None leaves sizes and render profile aside.
    """
    if manifest.task is None:
        found = _differences_of_imported(manifest, task)
    elif manifest.task != task.name:
        return [f"the videos show the task {manifest.task}: train on that one, or record {task.name}"]
    else:
        found = _differences_of_recorded(manifest, task)
    return found + (_differences_of_pictures(manifest, pictures) if pictures is not None else [])


def _differences_of_recorded(manifest: Manifest, task: Task) -> list[str]:
    found = []
    if manifest.action_repeat != task.action_repeat:
        found.append(
            f"one frame of the videos is {manifest.action_repeat} simulator steps after the other, and in "
            f"{task.name} it is {task.action_repeat}: record them again with --action-repeat {task.action_repeat}, or "
            f"pass --action-repeat {manifest.action_repeat} here"
        )
    if manifest.frames < task.episode_steps + 1:
        found.append(
            f"{_too_short(manifest, task)}: record them again with --episode-steps {task.episode_steps}, or pass "
            f"--episode-steps {manifest.frames - 1} here"
        )
    return found


def _differences_of_imported(manifest: Manifest, task: Task) -> list[str]:
    found = []
    if manifest.frames < task.episode_steps + 1:
        found.append(
            f"{_too_short(manifest, task)}: import them again with --frames {task.episode_steps + 1}, or pass "
            f"--episode-steps {manifest.frames - 1} here"
        )
    environment = make_environment(task.name, PictureConfig(), task.episode_steps, task.action_repeat)
    rate = environment.metadata["render_fps"]
    environment.close()
    if (
        environment.knows_time
        and manifest.frames_per_second
        and abs(rate - manifest.frames_per_second) > 0.01 * rate
    ):
        found.append(
            f"the videos show {manifest.frames_per_second:g} pictures a second and {task.name} shows {rate:g}, so "
            f"everything in them looks faster or slower: import them again with --fps {rate:g}"
        )
    return found


def _differences_of_pictures(manifest: Manifest, pictures: PictureConfig) -> list[str]:
    found = []
    size, profile = manifest.video_size, manifest.render_profile
    if profile is not None and profile != pictures.profile:
        found.append(
            f"the videos were rendered with profile {profile} and the run renders with {pictures.profile}: "
            f"pass --pictures.profile {profile}, or record the videos again with --profile {pictures.profile}"
        )
    if size != pictures.video_size:
        found.append(
            f"the videos are {size}×{size} pixels and the run reads {pictures.video_size}×{pictures.video_size}: "
            f"pass --pictures.video-size {size}, or make the videos again at {pictures.video_size}"
        )
    elif manifest.agent_size is not None and max(manifest.agent_size, size) != pictures.picture_size:
        found.append(
            f"the videos were rendered at {max(manifest.agent_size, size)} pixels and the run renders at "
            f"{pictures.picture_size} before it resizes: pass --pictures.agent-size {manifest.agent_size}, or "
            f"record the videos again with --agent-size {pictures.agent_size}"
        )
    return found


def _too_short(manifest: Manifest, task: Task) -> str:
    return (
        f"the videos have {manifest.frames} frames and an episode of {task.name} has {task.episode_steps + 1}"
    )
