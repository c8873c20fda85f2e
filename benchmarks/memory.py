"""What a run takes of the memory: is the announced amount right, does all fit into 8 GB, and does it stay flat?

    python -m benchmarks.memory --preset cpu

**Stores.** A fresh process fills one store after another with random pixels, and reads from the system what has become
resident; the sizes beside are those that `train` adds up for its line "memory when full". A second one builds a run's
parts as `train` does, fills them, takes a step of alignment, of inverse dynamics and of cloning, and plays two episodes
with everything that learns; what it took at most is the last row. Not in it: the second environment of an evaluation,
the demo set's index, and the encodings that the reward keeps of expert videos (30 KB each at 61 frames).

**Growth.** `train` itself runs on a small task with networks next to nothing, so that thousands of agent steps take
seconds; evaluations, checkpoints and logs are part of it. From outside, its resident memory is read whenever it logs.
The slope is a least-squares line's over the second half of the agent steps: in the first, the stores fill and the
process meets its largest gradient steps, whose memory it keeps. Its standard error takes the readings to be
independent, and memory moves in steps: look at first and last, too, and believe a slope only if a run of twice the
length has it as well.

Two Markdown tables come out. Linux only.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import gymnasium
import numpy as np
import torch
from rich.console import Console
from scipy.stats import linregress

from benchmarks.command import PROGRAM, command
from benchmarks.paper_size_demos import MB
from benchmarks.process_memory import status_bytes
from bootifol.errors import BootifolError, require_at_least
from bootifol.malloc import keep_freed_memory
from bootifol.presets import PRESETS, preset
from bootifol.replay.agent_videos import AgentVideos
from bootifol.replay.buffer import ReplayBuffer
from bootifol.reports.markdown import markdown_table
from bootifol.training.budget import Budget, Counters
from bootifol.training.build import Parts, build_environment, build_parts
from bootifol.training.interactive import InteractivePhase
from bootifol.training.interruption import Interruption
from bootifol.training.open_demos import Demos
from bootifol.training.run_config import RunConfig
from bootifol.types import Episode, FrameBatch, Video

Measured = TypeVar("Measured")

LIMIT = 8000 * MB
SETTLED = 0.5
"""Fraction of the agent steps before which memory may still grow."""

SMALL_RUN = """
    --preset smoke --threads 1 --pictures.agent-size 32 --pictures.video-size 32 --agent.replay-capacity 350
    --agent.warm-up-steps 60 --agent.batch-size 8 --agent.hidden-dim 16 --reward.bootifol.width-divisor 32
    --reward.bootifol.videos-per-class 2 --interactive.agent-videos 8 --alignment.gradient-steps 10
    --demonstrations.videos 8 --evaluation.held-out-videos 2 --checkpoint-minutes 0.05
"""
"""Everything that `cpu` does, as little of it as possible; its stores are full within 500 agent steps."""


class Reading(NamedTuple):
    """Memory of one thing, in bytes."""

    what: str
    announced: int
    resident: int


class Growth(NamedTuple):
    """Resident memory of a run while it learns."""

    first_step: int
    last_step: int
    readings: int
    first: int
    """Bytes."""
    last: int
    slope: float
    """Bytes an agent step."""
    error: float
    """Its standard error."""


class PixelsOnDemand:
    """Expert videos of random pixels that take no memory until they are read, behind the protocol of demo sets."""

    def __init__(self, count: int, frames: int, size: int) -> None:
        self._count = count
        self._shape = (frames, size, size, 3)

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> Video:
        frames = np.random.default_rng(index).integers(0, 256, self._shape, dtype=np.uint8)
        return Video(f"expert-{index}", frames)

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return rng.integers(0, 256, (count, *self._shape), dtype=np.uint8)


def run_of(task: str, preset_name: str, transitions: int) -> RunConfig:
    """A run of the preset whose replay holds so many transitions."""
    run = RunConfig(task, "bootifol", preset_name, 1, "random pixels", None, preset(preset_name))
    steps = run.resolved_task().episode_steps
    agent = replace(run.training.agent, replay_capacity=math.ceil(transitions / steps) * (steps + 1))
    return replace(run, training=replace(run.training, agent=agent))


def stores(run: RunConfig, action_dim: int) -> list[Reading]:
    """What the stores of a run take when full; to be called in a process of its own."""
    keep_freed_memory()
    config, frames = run.training, run.resolved_task().episode_steps + 1
    size, video_size = config.pictures.agent_size, config.pictures.video_size
    replays = {"replay": config.agent.replay_capacity}
    if config.demonstrations.fraction > 0:
        replays["demonstrations"] = config.demonstrations.videos * frames
    kept: list[object] = []
    readings = []
    for name, capacity in replays.items():
        before = status_bytes("VmRSS")
        replay = ReplayBuffer(capacity, size, action_dim)
        fill(replay, frames, size, action_dim)
        kept.append(replay)
        announced = ReplayBuffer.bytes_needed(capacity, size, action_dim)
        what = f"{name}: {len(replay):,} transitions"
        readings.append(Reading(what, announced, status_bytes("VmRSS") - before))
    before, count = status_bytes("VmRSS"), config.interactive.agent_videos
    agent_videos = AgentVideos(count, frames, video_size)
    for index in range(count):
        agent_videos.add(random_video(str(index), frames, video_size))
    announced = AgentVideos.bytes_needed(count, frames, video_size)
    readings.append(Reading(f"the agent's videos: {count:,}", announced, status_bytes("VmRSS") - before))
    return readings


def whole_process(run: RunConfig) -> int:
    """Bytes that a run's process took at most, its stores full and all of it at work; in a process of its own."""
    config, task = run.training, run.resolved_task()
    torch.set_num_threads(config.threads)
    keep_freed_memory()
    frames = task.episode_steps + 1
    expert = PixelsOnDemand(config.demonstrations.videos, frames, config.pictures.video_size)
    parts = build_parts(run, task, Console(stderr=True), Demos(expert, expert))
    fill(parts.replay, frames, config.pictures.agent_size, actions_of(parts.environment))
    for index in range(config.interactive.agent_videos):
        parts.agent_videos.add(expert[index])
    work(run, parts)
    return status_bytes("VmHWM")


def actions_of(environment: gymnasium.Env[Any, Any]) -> int:
    """Its action dimensions."""
    shape = environment.action_space.shape
    assert shape is not None
    return shape[0]


def random_video(name: str, frames: int, size: int) -> Video:
    """Pictures of random pixels."""
    rng = np.random.default_rng(0)
    return Video(name, rng.integers(0, 256, (frames, size, size, 3), dtype=np.uint8))


def fill(replay: ReplayBuffer, frames: int, size: int, action_dim: int) -> None:
    """Adds whole episodes of random pixels until every slot of the ring was written."""
    rng = np.random.default_rng(0)
    for index in range(replay.capacity // frames + 1):
        pictures = rng.integers(0, 256, (frames, size, size, 3), dtype=np.uint8)
        actions = rng.uniform(-1, 1, (frames - 1, action_dim)).astype(np.float32)
        episode = Episode(pictures, actions, Video(str(index), pictures), False)
        replay.add(episode, rng.normal(size=frames - 1).astype(np.float32))


def work(run: RunConfig, parts: Parts) -> None:
    """Everything that learns, once at least."""
    next(parts.reward_model.align(parts.demos.expert, parts.demos.random))
    config = run.training
    counters = Counters(agent_steps=config.agent.warm_up_steps)
    budget = Budget(config.interactive.agent_steps)
    rng = np.random.default_rng(0)
    if parts.demonstrations is not None:
        counters.cloning_phases = 1
        parts.demonstrations.learn_inverse_dynamics(parts.replay, 0, rng, learning_rate=1e-4)
        parts.demonstrations.infer(0, parts.reward_model, rng)
        parts.agent.clone(parts.demonstrations.sample(config.agent.batch_size, rng), learning_rate=1e-4)
    phase = InteractivePhase(
        parts,
        replace(config.interactive, reward_updates_until=config.interactive.agent_steps),
        budget,
        counters,
        run.seed,
        rng,
        Interruption(),
    )
    for _ in range(2):
        phase.play_episode()
    if not (counters.agent_updates and counters.reward_updates):
        raise BootifolError(
            f"two episodes of {run.task} are too short for an update of agent and reward: choose a task with longer "
            "episodes"
        )


def growth(task: str, agent_steps: int) -> Growth:
    """Lets `train` run on a small task and reads its resident memory whenever it logs."""
    with tempfile.TemporaryDirectory() as temporary:
        demos, out = f"{temporary}/demos", Path(temporary) / "run"
        sizes = ["--agent-size", "32", "--video-size", "32"]
        finished(["demos", "record", "--task", task, "--episodes", "16", "--out", demos, *sizes])
        steps = ["--interactive.agent-steps", str(agent_steps), "--interactive.reward-updates-until"]
        steps += [str(agent_steps), "--interactive.log-every", str(max(agent_steps // 60, 1))]
        steps += ["--evaluation.every", str(max(agent_steps // 8, 1)), *SMALL_RUN.split()]
        command = [*PROGRAM, "train", "--task", task, "--demos", demos, "--out", str(out), *steps]
        readings: dict[int, int] = {}
        # Its messages go to a file: they matter only where it fails, and a pipe nobody reads would fill.
        with (Path(temporary) / "messages").open("w+") as messages:
            process = subprocess.Popen(command, stdout=messages, stderr=messages)
            try:
                while process.poll() is None:
                    step = newest_step(out / "metrics.jsonl")
                    if step not in readings and 0 < step < agent_steps:
                        readings[step] = status_bytes("VmRSS", process.pid)
                    time.sleep(0.02)
            finally:  # whoever interrupts this leaves no run behind
                process.kill()
                process.wait()
            if process.returncode:
                messages.seek(0)
                raise BootifolError(f"the small run on {task} failed: {messages.read().strip()}")
    return line_through({step: size for step, size in readings.items() if step >= SETTLED * agent_steps})


def newest_step(metrics: Path) -> int:
    """Agent steps in the last whole line of `metrics.jsonl`; 0 before the agent acts."""
    if not metrics.exists():
        return 0
    whole = metrics.read_text().rpartition("\n")[0]
    return int(json.loads(whole.rpartition("\n")[2]).get("agent_steps", 0)) if whole else 0


def line_through(readings: dict[int, int]) -> Growth:
    """The least-squares line of resident bytes over agent steps.

    Raises:
        BootifolError: there are fewer than three readings.
    """
    if len(readings) < 3:
        raise BootifolError(
            f"memory was read {len(readings)} times while the small run learned, too few for a slope: give it more "
            "--steps"
        )
    steps, sizes = list(readings), list(readings.values())
    line = linregress(steps, sizes)
    error = 0.0 if len(set(sizes)) == 1 else float(line.stderr)  # which is NaN where nothing varies
    return Growth(steps[0], steps[-1], len(steps), sizes[0], sizes[-1], float(line.slope), error)


def finished(words: Sequence[str]) -> None:
    """Runs a command of `bootifol` to its end."""
    if subprocess.run([*PROGRAM, *words], stdout=subprocess.DEVNULL).returncode:
        raise BootifolError(f"`bootifol {' '.join(words)}` failed: its own message is above")


@command()
def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--preset", default="cpu", choices=list(PRESETS))
    parser.add_argument("--task", default="reacher_hard", help="whose stores are filled")
    parser.add_argument("--transitions", type=int, default=100_000, help="that replay holds")
    parser.add_argument("--steps", type=int, default=6000, help="agent steps of the small run")
    parser.add_argument("--small-task", default="drawn_home", help="what the small run learns")
    arguments = parser.parse_args(words)
    require_at_least(100, **{"--transitions": arguments.transitions})
    require_at_least(1000, **{"--steps": arguments.steps})
    run = run_of(arguments.task, arguments.preset, arguments.transitions)
    filled = alone(stores, run, actions_of(build_environment(run, 1)))
    print(stores_table(filled, alone(whole_process, run)), flush=True)
    print(f"\n{growth_table(growth(arguments.small_task, arguments.steps))}")


def alone(measure: Callable[..., Measured], *arguments: object) -> Measured:
    """The result of a function in a fresh process."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(measure, *arguments).result()


def stores_table(stores: Sequence[Reading], process: int) -> str:
    together = Reading(
        "all of these", sum(store.announced for store in stores), sum(store.resident for store in stores)
    )
    whole = Reading("the whole process at most (announced: the limit of 8 GB)", LIMIT, process)
    header = ["memory", "announced, MB", "resident, MB", "resident / announced"]
    cells = [
        [
            reading.what,
            f"{reading.announced / MB:.1f}",
            f"{reading.resident / MB:.1f}",
            f"{reading.resident / reading.announced:.3f}",
        ]
        for reading in (*stores, together, whole)
    ]
    return markdown_table(header, cells)


def growth_table(found: Growth) -> str:
    header = [
        "agent steps",
        "readings",
        "first, MB",
        "last, MB",
        "slope, KB per 1000 agent steps",
        "standard error",
    ]
    cells = [
        f"{found.first_step:,} to {found.last_step:,}",
        str(found.readings),
        f"{found.first / MB:.1f}",
        f"{found.last / MB:.1f}",
        f"{found.slope:.1f}",
        f"{found.error:.1f}",
    ]
    return markdown_table(header, [cells])


if __name__ == "__main__":
    raise SystemExit(main())
