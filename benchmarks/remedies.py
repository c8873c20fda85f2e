"""What does each departure from the paper bring? Variants of a preset at equal wall-clock.

    bootifol demos record --task drawn_home --agent-size 32 --video-size 32 --episodes 150 --out demos/drawn_home
    python -m benchmarks.remedies --demos demos/drawn_home --time-budget 90s --out results/drawn_home/remedies.csv

    python -m benchmarks.remedies --task reacher_hard --preset cpu --demos demos/reacher_hard --time-budget 25m \
        --variants preset "without demonstrations" --runs runs/remedies --out results/reacher_hard/remedies.csv

Every variant gets the same time for all phases, and learns only from videos (except `environment`, the upper bound).
Seeds are the outer loop, so that a machine that is busy for a while slows all variants alike. Finished rows are kept:
the same command goes on where it stopped.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.command import command
from benchmarks.resumable_table import ResumableTable
from bootifol.agents.config import DrQv2Config
from bootifol.envs.rollout import Act
from bootifol.errors import BootifolError
from bootifol.evaluation.returns import evaluate, scaled_return
from bootifol.evaluation.summary import summarize
from bootifol.presets import preset
from bootifol.rewards.registry import RewardConfig
from bootifol.tasks import make_environment, task_named
from bootifol.training.budget import parse_duration
from bootifol.training.config import TrainingConfig
from bootifol.training.demonstrations import DemonstrationConfig
from bootifol.training.interactive import evaluation_seeds
from bootifol.training.run_config import RunConfig
from bootifol.training.train import Run

EPISODES = 20
"""On which a policy is judged, of the task's evaluation length."""


def _reward(config: TrainingConfig, **fields: object) -> TrainingConfig:
    return replace(config, reward=RewardConfig(replace(config.reward.bootifol, **fields)))  # type: ignore[arg-type]


def _without_demonstrations(config: TrainingConfig) -> TrainingConfig:
    """The agent as in the paper: nothing inferred, nothing cloned, its own warm-up and noise."""
    paper = DrQv2Config()
    agent = replace(
        config.agent,
        cloning_weight=0.0,
        warm_up_steps=paper.warm_up_steps,
        warm_up_hold=paper.warm_up_hold,
        exploration_start=paper.exploration_start,
    )
    return replace(config, agent=agent, demonstrations=DemonstrationConfig())


VARIANTS: dict[str, Callable[[TrainingConfig], TrainingConfig]] = {
    "preset": lambda config: config,
    "cloning alone": lambda config: replace(config, agent=replace(config.agent, cloning_weight=1e6)),
    "without demonstrations": _without_demonstrations,
    "without demonstrations, spoiled_share 0.5": lambda config: _reward(
        _without_demonstrations(config), spoiled_share=0.5
    ),
    "without demonstrations, relabel_episodes 4": lambda config: replace(
        _without_demonstrations(config), interactive=replace(config.interactive, relabel_episodes=4)
    ),
    "environment": _without_demonstrations,
    "without saturation_weight": lambda config: replace(
        config, agent=replace(config.agent, saturation_weight=0.0)
    ),
    "reward_scale none": lambda config: _reward(config, reward_scale="none"),
    "reward frozen after alignment": lambda config: replace(
        config, interactive=replace(config.interactive, reward_updates_until=0)
    ),
    "spoiled_share 0.5": lambda config: _reward(config, spoiled_share=0.5),
    "relabel_episodes 4": lambda config: replace(
        config, interactive=replace(config.interactive, relabel_episodes=4)
    ),
    "demonstrations 1/4, cloning 0.5": lambda config: replace(
        config,
        demonstrations=DemonstrationConfig(
            share=0.25, videos=100, inverse_dynamics_updates=300, cloning_updates=0, repeat_every=2000
        ),
        agent=replace(config.agent, cloning_weight=0.5),
    ),
}
COLUMNS = ("variant", "seed", "seconds", "agent_steps", "mean_return", "scaled_return")


@command(resumes=True)
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", default="drawn_home")
    parser.add_argument("--preset", default="drawn")
    parser.add_argument("--demos", type=Path, required=True)
    parser.add_argument("--time-budget", default="90s", help="of each run")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--variants", nargs="+", default=list(VARIANTS), choices=list(VARIANTS))
    parser.add_argument(
        "--runs", type=Path, help="where to keep the runs and their curves; without it they go"
    )
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    results = ResumableTable(arguments.out, COLUMNS)
    console = Console()
    for seed in arguments.seeds:
        for variant in arguments.variants:
            if results.has(variant, seed):
                continue
            with tempfile.TemporaryDirectory() as temporary:
                directory = (
                    Path(temporary) if arguments.runs is None else arguments.runs / slug(variant, seed)
                )
                results.add(trained(arguments, variant, seed, directory))
            console.print(results.rows[-1])
    console.print(table(results.rows))


def slug(variant: str, seed: int) -> str:
    """The name of a variant's run directory."""
    return "-".join([*variant.replace(",", "").replace("/", "").split(), f"seed{seed}"])


def trained(arguments: argparse.Namespace, variant: str, seed: int, directory: Path) -> dict[str, str]:
    """One run and its policy's return."""
    config = replace(VARIANTS[variant](preset(arguments.preset)), threads=1, tensorboard=False)
    if arguments.runs is None:
        config = replace(config, evaluation=replace(config.evaluation, every=10**9))
    described = RunConfig(
        arguments.task,
        "environment" if variant == "environment" else "bootifol",
        arguments.preset,
        seed,
        str(arguments.demos),
        parse_duration(arguments.time_budget),
        config,
    )
    run = Run(described, directory, Console(quiet=True))
    described.write(directory, ["python", "-m", "benchmarks.remedies"])
    if not run.learn():
        raise KeyboardInterrupt  # Ctrl-C, which the run itself answers with a checkpoint
    agent, counters = run.components.agent, run.counters
    act: Act = lambda observation: agent.act(observation, 0, explore=False)  # noqa: E731
    task = task_named(arguments.task)
    environment = make_environment(arguments.task, config.pictures, task.evaluation_steps)
    results = evaluate(environment, act, evaluation_seeds(seed, EPISODES))
    mean = float(np.mean([result.environment_return for result in results]))
    scaled = scaled_return(mean, expert_return=task.expert_return, random_return=task.random_return)
    if scaled is None:
        raise BootifolError(
            f"{task.name} has no measured returns to compare with: choose a task of the catalogue"
        )
    return {
        "variant": variant,
        "seed": str(seed),
        "seconds": f"{counters.seconds:.0f}",
        "agent_steps": str(counters.agent_steps),
        "mean_return": f"{mean:.2f}",
        "scaled_return": f"{scaled:.3f}",
    }


def table(rows: list[dict[str, str]]) -> Table:
    """Means over seeds with 95 % bootstrap intervals."""
    shown = Table("variant", "seeds", "agent steps", "scaled return", "95 % interval")
    for variant in dict.fromkeys(row["variant"] for row in rows):
        of_variant = [row for row in rows if row["variant"] == variant]
        summary = summarize([float(row["scaled_return"]) for row in of_variant])
        interval = "–" if summary.interval is None else "{:.2f} … {:.2f}".format(*summary.interval)
        steps = np.mean([int(row["agent_steps"]) for row in of_variant])
        shown.add_row(variant, str(len(of_variant)), f"{steps:,.0f}", f"{summary.mean:.2f}", interval)
    return shown


if __name__ == "__main__":
    raise SystemExit(main())
