"""Demo sets of the paper's size: how fast they are recorded, what they take, and that learning from them takes little.

    python -m benchmarks.paper_size_demos --task reacher_hard --size bootifol --out demos/paper_size
    python -m benchmarks.paper_size_demos --task drawer_close --size eff_bootifol --out demos/paper_size

`bootifol` is 5000 videos of 61 pictures of 64×64, `eff_bootifol` 1500 of 51 of 224×224. After the expert's videos are
recorded (an interrupted recording goes on; the rate counts what this call recorded), a process that may take only
`--memory` MB more than its imports draws training batches from the set until it has read as many bytes as the set has,
and aligns the `cpu` preset's reward on it for a few gradient steps where the pictures have the preset's size. The
system kills no one here: a process that wants more than its limit gets an error. Linux only.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from benchmarks.command import command
from benchmarks.process_memory import status_bytes
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import MANIFEST_NAME, read_manifest
from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError, require_at_least
from bootifol.presets import CPU
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.tasks import TASKS

MB = 10**6


@dataclass(frozen=True)
class Size:
    """A demo set of the paper."""

    videos: int
    agent_steps: int
    picture: int
    """Height and width in pixels."""


SIZES = {"bootifol": Size(5000, 60, 64), "eff_bootifol": Size(1500, 50, 224)}


@dataclass(frozen=True)
class Reading:
    """What a process with little memory read."""

    videos: int
    seconds: float
    before: int
    """Resident bytes when everything was imported."""
    peak: int
    """Resident bytes at most."""


def read_within(directory: Path, memory: int, batch: int, gradient_steps: int) -> Reading:
    """Reads the set once over in random batches, and takes gradient steps; to be called in a process of its own.

    Args:
        directory: of the demo set.
        memory: bytes that the process may take from now on.
        batch: videos drawn at once.
        gradient_steps: of the preset's reward model, on these videos as both classes.
    """
    torch.set_num_threads(1)
    before = status_bytes("VmRSS")
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (status_bytes("VmSize") + memory, hard))
    demos = DemoSet.open(directory)
    rng = np.random.default_rng(0)
    started, read = time.perf_counter(), 0
    while read < len(demos):
        read += len(demos.sample(min(batch, len(demos)), rng))
    seconds = time.perf_counter() - started
    if gradient_steps:
        model = BootifolRewardModel(CPU.reward.bootifol, demos.manifest.video_size, seed=0)
        steps = model.align(demos, demos)
        for _ in range(gradient_steps):
            next(steps)
    return Reading(read, seconds, before, status_bytes("VmHWM"))


def recorded(task: str, size: Size, directory: Path, workers: int) -> str:
    """Records what is missing and says how fast, and how much memory it took."""
    there = len(read_manifest(directory).videos) if (directory / MANIFEST_NAME).exists() else 0
    pictures = PictureConfig(agent_size=size.picture, video_size=size.picture)
    started = time.perf_counter()
    record(task, "expert", size.videos, directory, pictures, episode_steps=size.agent_steps, workers=workers)
    seconds = time.perf_counter() - started
    if there == size.videos:
        return f"{size.videos} videos were there already"
    videos = size.videos - there
    described = (
        f"{videos} videos in {seconds:.0f} s: {videos / seconds:.2f} a second with {workers} worker(s); peak resident "
        f"memory {status_bytes('VmHWM') / MB:.0f} MB"
    )
    if workers == 1:
        return described
    # Of a process's children the system counts those that have ended; a new one begins with its parent's figure.
    worker = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    return f"{described}, and at most {worker / MB:.0f} MB a worker"


@command(resumes=True)
def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", default="reacher_hard", choices=list(TASKS))
    parser.add_argument("--size", default="bootifol", choices=SIZES)
    parser.add_argument("--videos", type=int, help="fewer than the paper's, to try it")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--memory", type=int, default=1000, help="MB that the reading process may take")
    parser.add_argument("--batch", type=int, default=16, help="videos drawn at once")
    parser.add_argument("--gradient-steps", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("demos/paper_size"))
    arguments = parser.parse_args(words)
    size = SIZES[arguments.size]
    if arguments.videos is not None:
        size = Size(arguments.videos, size.agent_steps, size.picture)
    require_at_least(1, **{"--videos": size.videos, "--memory": arguments.memory, "--batch": arguments.batch})
    directory = arguments.out / f"{arguments.task}-{arguments.size}-{size.videos}"
    print(recorded(arguments.task, size, directory, arguments.workers), flush=True)
    on_disk = sum(file.stat().st_size for file in directory.iterdir())
    print(f"{on_disk / 10**9:.3f} GB on disk in {directory}", flush=True)
    same_size = size.picture == CPU.pictures.video_size
    gradient_steps = arguments.gradient_steps if same_size else 0
    try:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as alone:
            reading = alone.submit(
                read_within, directory, arguments.memory * MB, arguments.batch, gradient_steps
            ).result()
    except (MemoryError, RuntimeError) as error:
        raise BootifolError(
            f"learning from {directory} within {arguments.memory} MB failed ({error}): give it more with --memory"
        ) from error
    print(
        f"drew {reading.videos} videos, {reading.videos * on_disk / size.videos / 10**9:.3f} GB, at "
        f"{reading.videos / reading.seconds:.0f} a second, and took {gradient_steps} gradient steps of the reward "
        f"on them; peak resident memory {reading.peak / MB:.0f} MB, of which {reading.before / MB:.0f} MB before "
        f"the first batch (allowed beyond: {arguments.memory} MB)"
    )


if __name__ == "__main__":
    raise SystemExit(main())
