"""Recording a demo set: episodes of one behavior, played in the task's environment, pictures only."""

from __future__ import annotations

import dataclasses
import math
import multiprocessing
import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext
from functools import cache, partial
from pathlib import Path
from typing import Any, get_args

import gymnasium
import numpy as np

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import (
    MANIFEST_NAME,
    Manifest,
    Shard,
    VideoEntry,
    installed_versions,
    read_manifest,
    write_manifest,
)
from bootifol.demos.own_policy import own_policy
from bootifol.demos.shards import (
    last_frame_held,
    sha256_of_file,
    sha256_of_frames,
    shard_number,
    videos_per_shard,
    write_shard,
)
from bootifol.envs.pictures import PictureConfig
from bootifol.envs.rollout import play_episode
from bootifol.errors import LARGEST_SEED, BootifolError, require_at_least, require_at_most
from bootifol.experts import Behavior, make_behavior
from bootifol.files import remove_leftovers
from bootifol.locks import NAME as LOCK
from bootifol.locks import one_writer
from bootifol.progress import progress
from bootifol.tasks import make_environment, task_named
from bootifol.types import Frames


@dataclasses.dataclass(frozen=True)
class Recording:
    """What decides every byte of a recorded set (together with the versions of the libraries)."""

    task: str
    behavior: Behavior
    episodes: int
    pictures: PictureConfig
    seed: int
    episode_steps: int
    action_repeat: int
    policy: str | None = None
    """The user's own `MODULE:FUNCTION` who plays the expert; None for the bundled one."""

    def video_seed(self, index: int) -> int:
        """The seed of one video, below 2^31.

        It does not depend on the behavior: video 7 of the expert and video 7 of the random set begin alike,
        so that no learner can tell the two sets apart by their first frames.
        """
        return int(np.random.SeedSequence([self.seed, index]).generate_state(1)[0] >> 1)


MOST_EPISODES = 10_000_000
"""Of a recording: a manifest holds a line of each."""

HALF_GOOD_VIDEOS = 64
"""Most half-good videos of one recording: they are for measuring, not for learning."""


def record_demos(
    task: str,
    out: Path | str,
    episodes: int = 200,
    behaviors: Sequence[Behavior] | None = None,
    pictures: PictureConfig | None = None,
    seed: int = 1,
    episode_steps: int | None = None,
    workers: int = 1,
    action_repeat: int | None = None,
    policy: str | None = None,
) -> dict[Behavior, DemoSet]:
    """Records everything a run learns from, one demo set a behavior: `out/expert`, `out/random`, `out/half_good`.

    Args:
        task: name in the catalogue of tasks, or of a Gymnasium environment.
        out: directory of the demo sets.
        episodes: videos of each behavior (of half_good at most `HALF_GOOD_VIDEOS`).
        behaviors: who performs; expert, random and half_good by default, or random alone where no expert is bundled.
            half_good, which takes an expert to be half as good as, is left out where there is none.
        pictures: sizes and render profile; 64×64 of profile fast by default, as the preset `cpu` reads them.
        seed: every video's seed derives from it and the video's index.
        episode_steps: agent steps of a video; the task's training episode by default.
        workers: processes that play episodes.
        action_repeat: simulator steps an agent step; the task's own by default.
        policy: as of `record`.

    Raises:
        BootifolError: as `record`.
    """
    has_expert = task_named(task).has_expert
    performing: Sequence[Behavior]
    if behaviors is None:
        performing = ("expert", "random", "half_good") if has_expert else ("random",)
        if policy is not None:
            performing = ("expert", "random")
    else:
        performing = [behavior for behavior in behaviors if has_expert or behavior != "half_good"]
    pictures = pictures or PictureConfig(agent_size=64, video_size=64)
    return {
        behavior: record(
            task,
            behavior,
            min(episodes, HALF_GOOD_VIDEOS) if behavior == "half_good" else episodes,
            Path(out) / behavior,
            pictures,
            seed,
            episode_steps,
            workers,
            action_repeat,
            policy if behavior == "expert" else None,
        )
        for behavior in performing
    }


def record(
    task: str,
    behavior: Behavior,
    episodes: int,
    out: Path | str,
    pictures: PictureConfig,
    seed: int = 1,
    episode_steps: int | None = None,
    workers: int = 1,
    action_repeat: int | None = None,
    policy: str | None = None,
) -> DemoSet:
    """Records a demo set, or goes on with one that was interrupted.

    The bytes depend on the arguments only: not on interruptions, and not on the number of workers. Files
    appear whole or not at all, so this may be stopped at any moment.

    Args:
        task: name in the catalogue of tasks, or of a Gymnasium environment.
        behavior: "expert", "half_good", "random" or "still".
        episodes: number of videos.
        out: directory of the set.
        pictures: sizes and render profile; the set holds pictures of `video_size`.
        seed: every video's seed derives from it and the video's index.
        episode_steps: agent steps of a video (T), the task's training episode by default.
        workers: processes that play episodes; 1 plays them in this one.
        action_repeat: simulator steps an agent step; the task's own by default.
        policy: who plays the expert in a Gymnasium environment, as of `own_policy`.

    Raises:
        BootifolError: another set is there already, the disk is too small, or a name is unknown.
    """
    require_at_least(1, episodes=episodes, workers=workers)
    require_at_most(MOST_EPISODES, episodes=episodes)
    require_at_most(max(64, 4 * (os.cpu_count() or 1)), workers=workers)
    require_at_least(0, seed=seed)
    require_at_most(LARGEST_SEED, seed=seed)
    if behavior not in get_args(Behavior):
        raise BootifolError(
            f"there is no behavior '{behavior}'; choose among {', '.join(get_args(Behavior))}"
        )
    performed = task_named(task, action_repeat, episode_steps)
    if behavior in ("expert", "half_good") and not performed.has_expert and policy is None:
        raise BootifolError(
            f"no expert is bundled for {task}: let a function of yours play it with `--policy MODULE:FUNCTION`, or "
            "import videos with `bootifol demos import` and record the other behaviors with `--behaviors random`"
        )
    out = Path(out)
    plan = Recording(
        task, behavior, episodes, pictures, seed, performed.episode_steps, performed.action_repeat, policy
    )
    only_read = (out / MANIFEST_NAME).exists() and not os.access(out, os.W_OK)
    with nullcontext() if only_read else one_writer(out):
        remove_leftovers(out)
        return _record(out, plan, workers)


def _record(out: Path, plan: Recording, workers: int) -> DemoSet:
    episodes = plan.episodes
    manifest = _begin(out, plan)
    per_shard = videos_per_shard(episodes, manifest.video_bytes)
    finished = _whole_shards(out, manifest)
    missing = [index for index in range(math.ceil(episodes / per_shard)) if index not in finished]
    if missing:
        _check_versions(out, manifest)
        _check_disk(out, len(missing) * per_shard * manifest.video_bytes)
        done = sum(shard.videos for shard, _ in finished.values())
        with (
            progress(f"recording {manifest.name}", episodes, done) as advance,
            _players(plan, min(workers, episodes - done)) as play,
        ):
            for index in missing:
                indices = range(index * per_shard, min((index + 1) * per_shard, episodes))
                videos: list[Frames] = []
                entries: list[VideoEntry] = []
                for number, frames in zip(indices, play(indices), strict=True):
                    videos.append(last_frame_held(frames, manifest.frames))
                    entries.append(_entry(plan, manifest, number, len(frames), videos[-1]))
                    advance()
                finished[index] = (write_shard(out, index, np.stack(videos)), entries)
                manifest = _with_shards(manifest, finished)
                write_manifest(out, manifest)
    return DemoSet.open(out)


def play(plan: Recording, index: int) -> Frames:
    """One video of the set, uint8 `[n, H, W, 3]` with `n` at most T + 1; the same in any process."""
    environment = _environment(plan.task, plan.pictures, plan.episode_steps, plan.action_repeat)
    seed = plan.video_seed(index)
    if plan.policy is not None:
        act = own_policy(plan.policy, environment)
    else:
        act = make_behavior(plan.behavior, plan.task, environment, seed)
    return play_episode(environment, act, seed, name="recorded").episode.video.frames


@cache
def _environment(
    task: str, pictures: PictureConfig, episode_steps: int, action_repeat: int
) -> gymnasium.Env[Any, Any]:
    """Kept until the process ends: freeing a renderer can spoil the pictures of the next one."""
    return make_environment(task, pictures, episode_steps, action_repeat)


def _begin(out: Path, plan: Recording) -> Manifest:
    """The manifest to go on with: that of the recording in `out`, or a new one without videos."""
    environment = _environment(plan.task, plan.pictures, plan.episode_steps, plan.action_repeat)
    if plan.policy is not None:
        own_policy(plan.policy, environment)  # refused before anything is written
    new = Manifest(
        name=f"{plan.task}-{plan.behavior}",
        complete=False,
        task=plan.task,
        behavior=plan.behavior,
        seed=plan.seed,
        episodes=plan.episodes,
        frames=plan.episode_steps + 1,
        video_size=plan.pictures.video_size,
        agent_size=plan.pictures.agent_size,
        render_profile=plan.pictures.profile,
        action_repeat=plan.action_repeat,
        frames_per_second=environment.metadata["render_fps"],
        conversion=None,
        versions=installed_versions(),
        shards=(),
        videos=(),
    )
    if not (out / MANIFEST_NAME).exists():
        if out.exists() and (not out.is_dir() or any(path.name != LOCK for path in out.iterdir())):
            raise BootifolError(
                f"{out} is there already and holds no demo set: choose another directory or remove it"
            )
        write_manifest(out, new)
        return new
    there = read_manifest(out)
    for field in dataclasses.fields(Manifest):
        if field.name in ("complete", "versions", "shards", "videos"):
            continue
        old, wanted = getattr(there, field.name), getattr(new, field.name)
        if old != wanted:
            raise BootifolError(
                f"{out} holds another demo set (its {field.name} is {old!r}, not {wanted!r}): "
                "choose another directory or remove it"
            )
    players = {entry.source.get("policy") for entry in there.videos} - {plan.policy}
    if players:
        raise BootifolError(
            f"{out} was played by {players.pop() or 'the bundled expert'}: choose another directory"
        )
    return there


def _whole_shards(out: Path, manifest: Manifest) -> dict[int, tuple[Shard, Sequence[VideoEntry]]]:
    """The finished shards whose bytes are still the ones that were written, by their number."""
    whole: dict[int, tuple[Shard, Sequence[VideoEntry]]] = {}
    first = 0
    for shard in manifest.shards:
        entries = manifest.videos[first : first + shard.videos]
        first += shard.videos
        path = out / shard.file
        if path.is_file() and sha256_of_file(path) == shard.sha256:
            whole[shard_number(shard.file)] = (shard, entries)
    return whole


def _with_shards(manifest: Manifest, finished: dict[int, tuple[Shard, Sequence[VideoEntry]]]) -> Manifest:
    in_order = [finished[index] for index in sorted(finished)]
    videos = tuple(entry for _, entries in in_order for entry in entries)
    return dataclasses.replace(
        manifest,
        complete=len(videos) == manifest.episodes,
        shards=tuple(shard for shard, _ in in_order),
        videos=videos,
    )


def _entry(plan: Recording, manifest: Manifest, index: int, length: int, frames: Frames) -> VideoEntry:
    return VideoEntry(
        name=f"{manifest.name}-{index:06d}",
        source={"behavior": plan.behavior, "seed": plan.video_seed(index)}
        | ({} if plan.policy is None else {"policy": plan.policy}),
        length=length,
        sha256=sha256_of_frames(frames),
    )


def _check_versions(out: Path, manifest: Manifest) -> None:
    installed = installed_versions()
    for package in sorted(manifest.versions.keys() | installed.keys()):
        old, new = manifest.versions.get(package), installed.get(package)
        if old != new:
            raise BootifolError(
                f"the recording in {out} was begun with {package} {old} and this is {package} {new}, whose "
                "pictures may differ: install that version again, or remove the directory and start anew"
            )


def _check_disk(out: Path, needed: int) -> None:
    free = shutil.disk_usage(out).free
    if needed > free:
        raise BootifolError(
            f"{out} needs {needed / 1e9:.1f} GB more and the disk has {free / 1e9:.1f} GB free: "
            "free some space or choose another directory"
        )


Play = Callable[[Iterable[int]], Iterable[Frames]]


@contextmanager
def _players(plan: Recording, workers: int) -> Iterator[Play]:
    """Plays the videos of the given indices and yields their frames in that order, in `workers` processes."""
    if workers == 1:
        yield lambda indices: map(partial(play, plan), indices)
        return
    # Spawned, not forked: a forked copy of an OpenGL context or of torch's threads may hang.
    pool = ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=_follow_parent
    )
    try:
        yield lambda indices: pool.map(partial(play, plan), indices)
    except BrokenProcessPool as error:
        raise BootifolError(
            "a worker process died while recording (out of memory, or OpenGL crashed): run the same command "
            "again, with --workers 1 if it happens again"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


def _follow_parent() -> None:
    """A worker leaves Ctrl-C to its parent, and ends when the parent is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
