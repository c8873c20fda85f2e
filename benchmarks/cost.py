"""What does each method cost? Seconds per 1000 agent steps, peak memory, and parameters, each in a fresh process.

    python -m benchmarks.cost --preset cpu --task reacher_hard --out results/reacher_hard/cost_cpu.csv

Measured is the Interactive Phase with everything in it: acting, rendering, updates of agent and reward, rewarding
each episode; and apart from it a gradient step of alignment, of which a run takes as many as the table says. The
Cloning Phases, the same for all methods, and evaluations are not measured here but by `benchmarks.stages`. Before the
clock starts, a warm-up, one step of inverse dynamics and two episodes pass; replay then holds so little that a
processor may keep it in its caches, which it cannot in a long run (`benchmarks.engine` times that). Finished rows are
kept: the same command goes on where it stopped. A Markdown table is written beside the CSV file.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import torch
from rich.console import Console

from benchmarks.command import command
from benchmarks.process_memory import status_bytes
from benchmarks.resumable_table import ResumableTable
from benchmarks.run_queue import PROGRAM, missing_demos, record_words
from benchmarks.suites import (
    RANDOM,
    VIDEOS,
    PlannedRun,
    System,
    every_system,
    policy_input_ablation,
)
from bootifol.demos.agent_videos import AgentVideos
from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.presets import PRESETS, preset
from bootifol.replay.buffer import ReplayBuffer
from bootifol.reports.markdown import markdown_table
from bootifol.tasks import short_name
from bootifol.training.alignment import alignment_phase
from bootifol.training.cloning import cloning_phase
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig
from bootifol.training.train import Run

COLUMNS = {
    "task": "task",
    "preset": "preset",
    "system": "system",
    "threads": "threads",
    "agent_steps": "agent steps timed",
    "alignment_steps": "gradient steps of alignment",
    "seconds_alignment": "s each",
    "seconds_learning": "s per 1000 agent steps, reward learning",
    "cpu_seconds_learning": "of them CPU time",
    "seconds_resting": "s per 1000 agent steps, reward at rest",
    "cpu_seconds_resting": "of them CPU time",
    "peak_memory_mb": "peak memory, MB",
    "stores_mb": "stores when full, MB",
    "reward_parameters": "parameters of the reward",
    "agent_parameters": "parameters of the agent",
}
"""Of the CSV file, and what they are called in Markdown."""

ALIGNMENT_STEPS = 8
"""Of which the first, which compiles and allocates, is not timed."""
BLOCKS = 3
"""Of agent steps that are timed; the median counts."""
FEW_VIDEOS = 40
"""Recorded where the task has none."""
DEMONSTRATIONS = 300
"""At most, where there are so many: more than a cache holds, as in a run."""


@command(resumes=True)
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", default="reacher_hard")
    parser.add_argument("--preset", default="cpu", choices=list(PRESETS))
    parser.add_argument(
        "--steps", type=int, default=300, help=f"agent steps of a block, {BLOCKS} of which are timed, twice"
    )
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--systems", nargs="+", help="by name; all by default")
    parser.add_argument(
        "--demos", type=Path, default=Path("demos"), help="directory of the videos, one a task"
    )
    parser.add_argument("--out", type=Path, help="results/TASK/cost_PRESET.csv")
    parser.add_argument("--measure", help=argparse.SUPPRESS)  # what the fresh process does
    arguments = parser.parse_args()
    if arguments.measure is not None:
        system = systems(arguments.preset, [arguments.measure], arguments.task)[0]
        print(json.dumps(measured(arguments, system)))
    else:
        compare(arguments)


def systems(preset_name: str, names: Sequence[str] | None, task: str) -> list[System]:
    """The systems of the paper's tables that learn, and the encoding-based agent, by name.

    Args:
        preset_name: of the suites that have them.
        names: of those wanted; None for all that are compared on the task.
        task: its name.

    Raises:
        BootifolError: there is none of a name.
    """
    known = {
        system.name: system
        for list_systems in (every_system, policy_input_ablation)
        for system in list_systems(preset(preset_name), timed=False)
        if system.method != RANDOM
    }
    for name in names or ():
        if name not in known:
            raise BootifolError(f"there is no system '{name}'; the systems are {', '.join(known)}")
    return [known[name] for name in names or known if names or known[name].is_compared_on(task)]


def compare(arguments: argparse.Namespace) -> None:
    """Measures what is not in the table yet, one fresh process after another."""
    task = short_name(arguments.task)
    out = arguments.out or Path("results") / task / f"cost_{arguments.preset}.csv"
    results = ResumableTable(out, tuple(COLUMNS), key=4)
    missing = [
        system
        for system in systems(arguments.preset, arguments.systems, arguments.task)
        if not results.has(arguments.task, arguments.preset, system.name, arguments.threads)
    ]
    with tempfile.TemporaryDirectory() as temporary:
        for number, system in enumerate(missing, start=1):
            print(f"measuring {system.name} ({number} of {len(missing)})", file=sys.stderr, flush=True)
            demos = videos_of(planned(arguments, system), arguments.demos, Path(temporary))
            words = ["--task", arguments.task, "--preset", arguments.preset, "--demos", str(demos)]
            words += ["--steps", str(arguments.steps), "--threads", str(arguments.threads)]
            command = [sys.executable, "-m", "benchmarks.cost", *words, "--measure", system.name]
            finished = subprocess.run(command, stdout=subprocess.PIPE, text=True)
            if finished.returncode:
                raise BootifolError(f"{system.name} could not be measured: its own message is above")
            results.add(json.loads(finished.stdout.splitlines()[-1]))
    table = markdown_table(list(COLUMNS.values()), [list(row.values()) for row in results.rows]) + "\n"
    with written_aside(out.with_suffix(".md")) as aside:
        aside.write_text(table)
    print(table, end="")


def planned(arguments: argparse.Namespace, system: System) -> PlannedRun:
    """The run of a suite that is measured in part."""
    return PlannedRun(arguments.task, system.preset or arguments.preset, system, seed=1)


def videos_of(run: PlannedRun, demos: Path, spare: Path) -> Path:
    """Where a run's videos are; if nowhere, a few are recorded in `spare`: they cost as much to learn from as many.

    Raises:
        BootifolError: there are none, and none could be recorded.
    """
    for place in (demos, spare):
        if not missing_demos(place / run.demos_name):
            return place / run.demos_name
    directory = spare / run.demos_name
    words = record_words(run.task, run.config, directory, FEW_VIDEOS, ("expert", "random"))
    if subprocess.run([*PROGRAM, *words]).returncode:
        raise BootifolError(f"there are no videos of {run.task} and none could be recorded: see above")
    return directory


def measured(arguments: argparse.Namespace, system: System) -> dict[str, str]:
    """A row of the table: one method in this process."""
    of_suite = planned(arguments, system)
    config = replace(of_suite.config, threads=arguments.threads)
    with tempfile.TemporaryDirectory() as temporary:
        described = RunConfig(
            arguments.task, system.method, of_suite.preset, 1, str(arguments.demos), None, shortened(config)
        )
        run = Run(described, Path(temporary), Console(quiet=True))
        alignment = prepare(run)
        learning = seconds_per_1000(run, arguments.steps)
        resting = None
        if not run.components.reward_model.keeps_learning:
            run.interactive.config = replace(run.interactive.config, reward_updates_until=0)
            resting = seconds_per_1000(run, arguments.steps)
        reward, agent = run.components.reward_model, run.components.agent
        return {
            "task": arguments.task,
            "preset": arguments.preset,
            "system": system.name,
            "threads": str(arguments.threads),
            "agent_steps": str(BLOCKS * arguments.steps),
            "alignment_steps": str(config.alignment.gradient_steps if alignment else 0),
            "seconds_alignment": f"{alignment:.2f}" if alignment else "",
            "seconds_learning": f"{learning.wall_clock:.1f}",
            "cpu_seconds_learning": f"{learning.cpu:.1f}",
            "seconds_resting": f"{resting.wall_clock:.1f}" if resting else "",
            "cpu_seconds_resting": f"{resting.cpu:.1f}" if resting else "",
            "peak_memory_mb": f"{status_bytes('VmHWM') / 1e6:.0f}",
            "stores_mb": f"{stores_when_full(config, run) / 1e6:.0f}",
            "reward_parameters": str(parameters([getattr(reward, "networks", None)])),
            "agent_parameters": str(parameters([agent.encoder, agent.actor, agent.critic])),
        }


def shortened(config: TrainingConfig) -> TrainingConfig:
    """The same work an agent step, with next to nothing before it."""
    demonstrations = replace(
        config.demonstrations, phases=1, inverse_dynamics_updates=1, cloning_updates=0, videos=DEMONSTRATIONS
    )
    return replace(
        config,
        alignment=replace(config.alignment, gradient_steps=ALIGNMENT_STEPS),
        agent=replace(config.agent, warm_up_steps=1),
        demonstrations=demonstrations,
        evaluation=replace(config.evaluation, held_out_videos=0),
        tracker="none",
    )


def prepare(run: Run) -> float:
    """What comes before the phase that is measured: alignment, warm-up, cloning, and whatever compiles at first.

    Returns:
        Seconds of a gradient step of alignment, their median; 0 for a method that takes none.
    """
    parts, counters = run.components, run.counters
    ends = [time.perf_counter()]
    for _ in alignment_phase(parts.reward_model, run.demos.expert, run.demos.random, run.budget, counters):
        ends.append(time.perf_counter())
    for _ in range(2):
        run.interactive.play_episode()
        if run.interactive.cloning_due:
            assert parts.demonstrations is not None
            for _ in cloning_phase(
                parts.agent,
                parts.demonstrations,
                parts.replay,
                parts.reward_model,
                run.rng,
                run.budget,
                counters,
            ):
                pass
    aligned = [end - start for start, end in pairwise(ends)][1:]
    return statistics.median(aligned) if aligned else 0.0


class Seconds(NamedTuple):
    """Per 1000 agent steps. Less CPU time than threads times wall-clock: the machine was busy with other work."""

    wall_clock: float
    cpu: float


def seconds_per_1000(run: Run, agent_steps: int) -> Seconds:
    """The median of a few blocks of whole episodes, of so many agent steps each, after an episode that is not timed."""
    run.interactive.play_episode()
    blocks = []
    for _ in range(BLOCKS):
        first, started, cpu_started = run.counters.agent_steps, time.perf_counter(), time.process_time()
        while run.counters.agent_steps - first < agent_steps:
            run.interactive.play_episode()
        thousands = (run.counters.agent_steps - first) / 1000
        blocks.append(
            Seconds(
                (time.perf_counter() - started) / thousands, (time.process_time() - cpu_started) / thousands
            )
        )
    return sorted(blocks)[BLOCKS // 2]


def stores_when_full(config: TrainingConfig, run: Run) -> int:
    """Bytes of the frames, or of their features, that a whole run of a suite keeps; a short one fills few of them."""
    size, frames = config.pictures.agent_size, run.task.episode_steps + 1
    action_dim = run.interactive.environment.action_space.shape or (0,)
    replay = ReplayBuffer.bytes_needed(config.agent.replay_capacity, size, action_dim[0])
    backbone = run.components.backbone
    videos = AgentVideos.bytes_needed(
        config.interactive.agent_videos,
        frames,
        config.pictures.video_size,
        backbone.feature_size if backbone else 0,
    )
    demonstrated = 0
    if run.components.demonstrations is not None:
        count = min(config.demonstrations.videos, VIDEOS[run.run.preset])
        demonstrated = ReplayBuffer.bytes_needed(count * frames, size, action_dim[0])
    return replay + videos + demonstrated


def parameters(networks: Iterable[torch.nn.Module | None]) -> int:
    """How many numbers they learn."""
    return sum(p.numel() for network in networks if network is not None for p in network.parameters())


if __name__ == "__main__":
    raise SystemExit(main())
