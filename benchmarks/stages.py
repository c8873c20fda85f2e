"""Where does the time of a run go? What each stage costs, how often it is done, and what fraction of the run that is.

    python -m benchmarks.stages --preset cpu --task reacher_hard --demos demos/reacher_hard
    python -m benchmarks.stages --demos demos/reacher_hard --config.agent.update-every 8   # any field of the preset

Every stage is timed on the preset's own sizes, with the videos and the replay of a run after its warm-up: medians of
`--runs` calls after one that is not counted; what takes seconds (all videos of a Cloning Phase, an evaluation, a
checkpoint) is timed once, as it comes. How often each happens in the preset's own count of agent steps, without a
time budget, follows from its configuration, so no run has to be played to its end; the final evaluation, the showcase
and the report are not counted.

"arithmetic ms" is what the multiplications and additions of our own code, as PyTorch counts them, would take at the
measured rate of a large bf16 matrix product. What the work itself needs, and bytes, are in `benchmarks.engine`.
Markdown.
"""

from __future__ import annotations

import functools
import itertools
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console

from benchmarks.command import command
from benchmarks.engine import measured_rates, operations_of
from bootifol.cli.train import preset_of
from bootifol.networks.backbones import Backbone
from bootifol.progress import progress
from bootifol.reports.markdown import markdown_table
from bootifol.rewards.references import draw_references
from bootifol.tracking import RunLog
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer
from bootifol.types import Video

HEADER = ("stage", "in a run", "ms each", "arithmetic ms", "ms an agent step", "fraction")

HIGHEST_RATE = 1e-4
"""Learning rate of the timed steps of the Cloning Phase: what it is changes no time."""


@dataclass(frozen=True)
class Stage:
    """A stage of a run."""

    name: str
    calls: float
    """In a whole run."""
    work: Callable[[], object]
    computes: bool = True
    """Whether its arithmetic says something: not of simulation, rendering and files."""
    slow: bool = False
    """Takes seconds, and is timed once."""


def stages_of(run: Trainer) -> Iterator[Stage]:
    """Every stage of a run that has been warmed up, in the order of a run."""
    config, parts, interactive = run.config.training, run.parts, run.interactive
    steps, warm_up = config.interactive.agent_steps, config.agent.warm_up_steps
    acting, model, agent = steps - warm_up, parts.reward_model, parts.agent
    updates = acting / config.agent.update_every

    alignment = model.align(parts.demos.expert, parts.demos.random)
    if config.alignment.gradient_steps and next(alignment, None) is not None:
        yield Stage("alignment step", config.alignment.gradient_steps, functools.partial(next, alignment))
    if parts.demonstrations is not None:
        shown, rng = parts.demonstrations, run.rng
        phases = cloning_phases(config)
        yield Stage(
            "Cloning Phase: gradient step of the inverse dynamics",
            phases * shown.config.inverse_dynamics_updates,
            lambda: shown.learn_inverse_dynamics(parts.replay, 0, rng, HIGHEST_RATE),
        )

        def infer_all() -> None:
            for index in range(len(shown)):
                shown.infer(index, model, rng)

        yield Stage(
            f"Cloning Phase: actions and rewards of {len(shown):,} videos", phases, infer_all, slow=True
        )
        yield Stage(
            "Cloning Phase: gradient step of the clone",
            phases * shown.config.cloning_updates,
            lambda: agent.clone(shown.sample(config.agent.batch_size, rng), HIGHEST_RATE),
        )
    environment = interactive.environment
    observation, _ = environment.reset(seed=0)
    action = agent.act(observation, 0, explore=True)

    def step() -> None:
        _, _, terminated, truncated, _ = environment.step(action)
        if terminated or truncated:
            environment.reset(seed=0)

    yield Stage("agent step of the environment", steps, step, computes=False)
    yield Stage("action of the agent", acting, lambda: agent.act(observation, 0, explore=True))
    yield Stage("batch from replay", updates, interactive._batch, computes=False)
    batch = interactive._batch()
    yield Stage("update of the agent", updates, lambda: agent.update(batch, 0))
    if not model.reads_environment_reward:
        yield from reward_stages(run)
    # One every so many agent steps, and one after every Cloning Phase.
    evaluations = steps // config.evaluation.every + (cloning_phases(config) if parts.demonstrations else 0)
    yield Stage(
        "evaluation on the way",
        evaluations,
        run.evaluator.returns_on_the_way,
        computes=False,
        slow=True,
    )
    yield Stage(
        f"checkpoint, each {config.checkpoint_minutes:g} minutes", 0, run._checkpoint, False, slow=True
    )


def reward_stages(run: Trainer) -> Iterator[Stage]:
    """What a learned reward does while the agent acts."""
    config, parts, interactive = run.config.training, run.parts, run.interactive
    steps, model, length = config.interactive.agent_steps, parts.reward_model, run.task.episode_steps
    expert, agent_videos = parts.demos.expert, interactive.shown_agent_videos
    until = steps if model.keeps_learning else min(config.interactive.reward_updates_until, steps)
    version = model.version
    model.update(expert, agent_videos)
    if model.version == version:  # it learns only before the agent acts
        until = 0
    updates = max(until - config.agent.warm_up_steps, 0) / config.interactive.reward_update_every
    if updates:
        yield Stage("gradient step of the reward", updates, lambda: model.update(expert, agent_videos))
        if config.interactive.relabel_episodes:
            renewed = updates * config.interactive.relabel_episodes
            yield Stage("renewing a stored episode's rewards", renewed, interactive._relabel_one)
    video, numbers = parts.agent_videos[0], itertools.count()
    if isinstance(parts.featurizer, Backbone):
        backbone, size = parts.featurizer, config.pictures.video_size
        seen = Video("seen", np.zeros((length + 1, size, size, 3), np.uint8))
        yield Stage("features of an episode", steps / length, lambda: backbone.with_features(seen))
    references = draw_references(model, expert, run.rng)

    def label_anew() -> None:
        unknown = [replace(each, name=f"never seen {next(numbers)}") for each in references]
        model.label(video, unknown)

    # As soon as the reward has learned, nothing is left of the encodings of expert videos.
    if until:
        yield Stage("rewarding an episode while the reward learns", until / length, label_anew)
    at_rest = (steps - until) / length
    yield Stage("rewarding an episode when it rests", at_rest, lambda: model.label(video, references))


def cloning_phases(config: TrainingConfig) -> int:
    """How many there are in so many agent steps."""
    after = config.interactive.agent_steps - config.agent.warm_up_steps
    return min(config.demonstrations.phases, 1 + max(after - 1, 0) // config.demonstrations.repeat_every)


def warm_up(run: Trainer) -> None:
    """The episodes with which every run begins, so that replay and the agent's videos have something in them."""
    steps = run.config.training.agent.warm_up_steps
    with progress("warm-up", steps) as advance:
        while run.counters.agent_steps < steps:
            before = run.counters.agent_steps
            run.interactive.play_episode()
            advance(run.counters.agent_steps - before)


def milliseconds(stage: Stage, runs: int) -> float:
    """The median of some calls, quick ones in blocks, after one that is not counted; of a slow stage the only one."""
    block = 1
    if stage.slow:
        runs = 1
    else:
        started = time.perf_counter()
        stage.work()
        block = max(1, int(0.02 / max(time.perf_counter() - started, 1e-6)))
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        for _ in range(block):
            stage.work()
        times.append(1e3 * (time.perf_counter() - started) / block)
    return statistics.median(times)


def arithmetic_milliseconds(stage: Stage, rate: float) -> float | None:
    """Of its multiplications and additions at `rate` a second; None where there are none to count."""
    if not stage.computes:
        return None
    return 1e3 * operations_of(stage.work) / rate


def measure(
    config: Annotated[TrainingConfig, tyro.conf.arg(name="config")],
    demos: Path,
    task: str = "reacher_hard",
    method: str = "bootifol",
    preset: str = "cpu",
    runs: int = 9,
) -> None:
    """Where the time of a run goes.

    Args:
        config: every setting of the preset, which `--config.SECTION.FIELD` changes one by one.
        demos: directory of the videos.
        task: in whose environment to act.
        method: whose reward.
        preset: whose sizes and counts.
        runs: timed calls of each stage.
    """
    steps = config.interactive.agent_steps
    arithmetic = measured_rates().arithmetic
    with tempfile.TemporaryDirectory() as temporary:
        short = replace(config, tracker="none")
        run = Trainer(
            RunConfig(task, method, preset, 1, str(demos), None, short), Path(temporary), Console(stderr=True)
        )
        warm_up(run)
        rows = []
        run.log = RunLog(Path(temporary))
        for stage in stages_of(run):
            each = milliseconds(stage, runs)
            rows.append((stage, each, arithmetic_milliseconds(stage, arithmetic)))
            print(f"{stage.name}: {each:.2f} ms", file=sys.stderr, flush=True)
    total = sum(stage.calls * each for stage, each, _ in rows)
    cells = [
        [
            stage.name,
            f"{stage.calls:,.0f}" if stage.calls else "–",
            f"{each:.2f}",
            "" if least is None else f"{least:.2f}",
            f"{stage.calls * each / steps:.2f}" if stage.calls else "–",
            f"{stage.calls * each / total:.0%}" if stage.calls else "–",
        ]
        for stage, each, least in rows
    ]
    cells.append(
        ["all", f"{steps:,} agent steps", "", "", f"{total / steps:.2f}", f"{total / 6e4:.0f} minutes"]
    )
    print(f"{config.threads} thread(s), {arithmetic / 1e9:.0f} GFLOP/s in bf16\n")
    print(markdown_table(HEADER, cells))


@command()
def main() -> None:
    words = sys.argv[1:]
    tyro.cli(
        functools.partial(measure, config=preset_of(words)),
        args=words,
        config=(tyro.conf.FlagConversionOff,),
    )


if __name__ == "__main__":
    raise SystemExit(main())
