"""What does each method cost? Seconds per 1000 agent steps, peak memory, and parameters, each in a fresh process.

    python -m benchmarks.cost benchmarks/suites/cpu.yaml --task reacher_hard --out results/reacher_hard/cost_cpu.csv

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

from benchmarks.command import PROGRAM, command
from benchmarks.process_memory import status_bytes
from benchmarks.resumable_table import ResumableTable
from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.networks.backbones import Backbone
from bootifol.replay.agent_videos import AgentVideos
from bootifol.replay.buffer import ReplayBuffer
from bootifol.reports.markdown import markdown_table
from bootifol.sweep.planned import RANDOM, PlannedRun, missing_videos, record_words
from bootifol.sweep.sweep_file import read_sweep
from bootifol.tasks import short_name
from bootifol.training.alignment import alignment_phase
from bootifol.training.cloning import cloning_phase
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer

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
    parser.add_argument("sweep", type=Path, metavar="FILE.yaml", help="of `bootifol sweep`, with the systems")
    parser.add_argument("--task", default="reacher_hard", help="of the file's")
    parser.add_argument(
        "--steps", type=int, default=300, help=f"agent steps of a block, {BLOCKS} of which are timed, twice"
    )
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--systems", nargs="+", help="by name; all that learn by default")
    parser.add_argument("--out", type=Path, help="results/TASK/cost_FILE.csv")
    parser.add_argument(
        "--measure", type=Path, metavar="DEMOS", help=argparse.SUPPRESS
    )  # in the fresh process
    arguments = parser.parse_args()
    if arguments.measure is None:
        compare(arguments)
    else:
        (run,) = systems(arguments.sweep, arguments.task, arguments.threads, arguments.systems)
        print(json.dumps(measured(replace(run, demos=arguments.measure), arguments.steps)))


def systems(sweep: Path, task: str, threads: int, names: Sequence[str] | None = None) -> list[PlannedRun]:
    """A run of each system of a sweep that learns on a task.

    Args:
        sweep: its file.
        task: its name.
        threads: that each is measured with.
        names: of the systems wanted, as METHOD or METHOD-VARIANT; None for all.

    Raises:
        BootifolError: the file has none of a name on that task.
    """
    known = {
        run.system: replace(run, cpus=threads)
        for run in read_sweep(sweep)
        if run.task == task and run.method != RANDOM
    }
    for name in names or ():
        if name not in known:
            raise BootifolError(f"there is no system '{name}' on {task}; the systems are {', '.join(known)}")
    if not known:
        raise BootifolError(f"{sweep} has no run on {task} that learns: name one of its tasks")
    return [known[name] for name in names or known]


def compare(arguments: argparse.Namespace) -> None:
    """Measures what is not in the table yet, one fresh process after another."""
    task = short_name(arguments.task)
    out = arguments.out or Path("results") / task / f"cost_{arguments.sweep.stem}.csv"
    results = ResumableTable(out, tuple(COLUMNS), key=4)
    missing = [
        run
        for run in systems(arguments.sweep, arguments.task, arguments.threads, arguments.systems)
        if not results.has(run.task, run.preset, run.system, run.cpus)
    ]
    with tempfile.TemporaryDirectory() as temporary:
        for number, run in enumerate(missing, start=1):
            print(f"measuring {run.system} ({number} of {len(missing)})", file=sys.stderr, flush=True)
            words = [str(arguments.sweep), "--task", run.task, "--threads", str(run.cpus)]
            words += ["--steps", str(arguments.steps), "--measure", str(videos_of(run, Path(temporary)))]
            command = [sys.executable, "-m", "benchmarks.cost", *words, "--systems", run.system]
            finished = subprocess.run(command, stdout=subprocess.PIPE, text=True)
            if finished.returncode:
                raise BootifolError(f"{run.system} could not be measured: its own message is above")
            results.add(json.loads(finished.stdout.splitlines()[-1]))
    table = markdown_table(list(COLUMNS.values()), [list(row.values()) for row in results.rows]) + "\n"
    with written_aside(out.with_suffix(".md")) as aside:
        aside.write_text(table)
    print(table, end="")


def videos_of(run: PlannedRun, spare: Path) -> Path:
    """Where a run's videos are; if nowhere, a few are recorded in `spare`: they cost as much to learn from as many.

    Raises:
        BootifolError: there are none, and none could be recorded.
    """
    directory = spare / run.demos.name
    for place in (run.demos, directory):
        if not missing_videos(place):
            return place
    words = record_words(replace(run, demos=directory), ("expert", "random"), FEW_VIDEOS)
    if subprocess.run([*PROGRAM, *words]).returncode:
        raise BootifolError(f"there are no videos of {run.task} and none could be recorded: see above")
    return directory


def measured(planned: PlannedRun, steps: int) -> dict[str, str]:
    """A row of the table: one method in this process.

    Args:
        planned: what is measured in part.
        steps: agent steps of a block.
    """
    config = planned.config
    with tempfile.TemporaryDirectory() as temporary:
        described = RunConfig(
            planned.task, planned.method, planned.preset, 1, str(planned.demos), None, shortened(config)
        )
        run = Trainer(described, Path(temporary), Console(quiet=True))
        alignment = prepare(run)
        learning = seconds_per_1000(run, steps)
        resting = None
        if not run.parts.reward_model.keeps_learning:
            run.interactive.config = replace(run.interactive.config, reward_updates_until=0)
            resting = seconds_per_1000(run, steps)
        reward, agent = run.parts.reward_model, run.parts.agent
        return {
            "task": planned.task,
            "preset": planned.preset,
            "system": planned.system,
            "threads": str(planned.cpus),
            "agent_steps": str(BLOCKS * steps),
            "alignment_steps": str(config.alignment.gradient_steps if alignment else 0),
            "seconds_alignment": f"{alignment:.2f}" if alignment else "",
            "seconds_learning": f"{learning.wall_clock:.1f}",
            "cpu_seconds_learning": f"{learning.cpu:.1f}",
            "seconds_resting": f"{resting.wall_clock:.1f}" if resting else "",
            "cpu_seconds_resting": f"{resting.cpu:.1f}" if resting else "",
            "peak_memory_mb": f"{status_bytes('VmHWM') / 1e6:.0f}",
            "stores_mb": f"{stores_when_full(planned, run) / 1e6:.0f}",
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


def prepare(run: Trainer) -> float:
    """What comes before the phase that is measured: alignment, warm-up, cloning, and whatever compiles at first.

    Returns:
        Seconds of a gradient step of alignment, their median; 0 for a method that takes none.
    """
    parts, counters = run.parts, run.counters
    ends = [time.perf_counter()]
    expert, random = parts.demos.expert, parts.demos.random
    for _ in alignment_phase(parts.reward_model, expert, random, run.budget, counters, log_every=1):
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
                log_every=1,
            ):
                pass
    aligned = [end - start for start, end in pairwise(ends)][1:]
    return statistics.median(aligned) if aligned else 0.0


class Seconds(NamedTuple):
    """Per 1000 agent steps. Less CPU time than threads times wall-clock: the machine was busy with other work."""

    wall_clock: float
    cpu: float


def seconds_per_1000(run: Trainer, agent_steps: int) -> Seconds:
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


def stores_when_full(planned: PlannedRun, run: Trainer) -> int:
    """Bytes of the frames, or of their features, that a whole run of a sweep keeps; a short one fills few of them."""
    config = planned.config
    size, frames = config.pictures.agent_size, run.task.episode_steps + 1
    action_dim = run.interactive.environment.action_space.shape or (0,)
    replay = ReplayBuffer.bytes_needed(config.agent.replay_capacity, size, action_dim[0])
    featurizer = run.parts.featurizer
    videos = AgentVideos.bytes_needed(
        config.interactive.agent_videos,
        frames,
        config.pictures.video_size,
        featurizer.feature_size if isinstance(featurizer, Backbone) else 0,
    )
    demonstrated = 0
    if run.parts.demonstrations is not None:
        count = min(config.demonstrations.videos, planned.videos or config.demonstrations.videos)
        demonstrated = ReplayBuffer.bytes_needed(count * frames, size, action_dim[0])
    return replay + videos + demonstrated


def parameters(networks: Iterable[torch.nn.Module | None]) -> int:
    """How many numbers they learn."""
    return sum(p.numel() for network in networks if network is not None for p in network.parameters())


if __name__ == "__main__":
    raise SystemExit(main())
