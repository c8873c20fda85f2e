"""Do videos fit a task and the pictures of a run?"""

from __future__ import annotations

from typing import Any

from bootifol.demos.manifest import Manifest
from bootifol.envs.pictures import PictureConfig
from bootifol.tasks import Task, frames_per_second


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


def look_alike(expert: Manifest, other: Manifest) -> bool:
    """Whether both sets come from files, or both from the simulator. A single frame of a file is told from the
    simulator's own by its compression, and then by nothing else."""
    return (expert.conversion is None) == (other.conversion is None)


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
    rate = frames_per_second(task)
    if rate and manifest.frames_per_second and abs(rate - manifest.frames_per_second) > 0.01 * rate:
        found.append(
            f"the videos show {manifest.frames_per_second:g} pictures a second and {task.name} shows {rate:g}, so "
            f"everything in them looks faster or slower: import them again with --fps {rate:g}"
        )
    return found


def _differences_of_pictures(manifest: Manifest, pictures: PictureConfig) -> list[str]:
    found = []
    size, profile = manifest.video_size, manifest.render_profile
    rendered = max(manifest.agent_size or 0, size)
    if size != pictures.video_size:
        found.append(f"{size}×{size} pixels where the run reads {pictures.video_size}×{pictures.video_size}")
    elif manifest.agent_size is not None and rendered != pictures.picture_size:
        found.append(f"rendered at {rendered} pixels where the run renders at {pictures.picture_size}")
    if profile is not None and profile != pictures.profile:
        found.append(f"rendered with profile {profile} where the run renders with {pictures.profile}")
    if not found:
        return []
    again = f"import them again with --size {pictures.video_size}"
    if manifest.task is not None:
        again = (
            f"record them again with --video-size {pictures.video_size} --agent-size {pictures.agent_size} "
            f"--profile {pictures.profile}"
        )
    return [f"the videos are {', and '.join(found)}: pass {picture_flags(manifest, pictures)}, or {again}"]


def picture_flags(manifest: Manifest, pictures: PictureConfig) -> str:
    """What a run with these pictures must be told to see the environment as the videos show it; "" for nothing."""
    return " ".join(
        f"--pictures.{name.replace('_', '-')} {value}"
        for name, value in shown_like(manifest, pictures).items()
        if value != getattr(pictures, name)
    )


def shown_like(manifest: Manifest, pictures: PictureConfig) -> dict[str, Any]:
    """The sizes and the profile of videos.

    Imported ones know no profile and no size for the agent: the run's own remain, but for an agent that would see more
    pixels than the videos have.
    """
    return {
        "video_size": manifest.video_size,
        "agent_size": manifest.agent_size or min(pictures.agent_size, manifest.video_size),
        "profile": manifest.render_profile or pictures.profile,
    }


def _too_short(manifest: Manifest, task: Task) -> str:
    return (
        f"the videos have {manifest.frames} frames and an episode of {task.name} has {task.episode_steps + 1}"
    )
