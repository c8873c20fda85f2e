"""What does each departure from the paper bring? Variants at equal wall-clock on a task drawn with numpy.

    bootifol demos record --task drawn_home --agent-size 32 --video-size 32 --episodes 150 --out demos/drawn_home
    python -m benchmarks.remedies --demos demos/drawn_home --time-budget 90s --out results/drawn_home/remedies.csv

Every variant gets the same time for both phases, learning only from videos. Seeds are the outer loop, so that a machine
that is busy for a while slows all variants alike. Finished rows are kept: the same command goes on where it stopped.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from bootifol.envs.rollout import Act
from bootifol.evaluation.returns import evaluate, scaled_return
from bootifol.evaluation.summary import summarize
from bootifol.files import written_aside
from bootifol.presets import DRAWN
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


VARIANTS: dict[str, Callable[[TrainingConfig], TrainingConfig]] = {
    "preset drawn": lambda config: config,
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
        demonstrations=DemonstrationConfig(share=0.25, videos=100, first_updates=300, updates=50),
        agent=replace(config.agent, cloning_weight=0.5),
    ),
}
COLUMNS = ("variant", "seed", "seconds", "agent_steps", "mean_return", "scaled_return")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", default="drawn_home")
    parser.add_argument("--demos", type=Path, required=True)
    parser.add_argument("--time-budget", default="90s", help="of each run")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--variants", nargs="+", default=list(VARIANTS), choices=list(VARIANTS))
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, str]] = []
    if arguments.out.exists():
        with arguments.out.open(newline="") as file:
            rows = list(csv.DictReader(file))
    done = {(row["variant"], row["seed"]) for row in rows}
    console = Console()
    for seed in arguments.seeds:
        for variant in arguments.variants:
            if (variant, str(seed)) in done:
                continue
            rows.append(trained(variant, seed, arguments.task, arguments.demos, arguments.time_budget))
            console.print(rows[-1])
            with written_aside(arguments.out) as aside, aside.open("w", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS)
                writer.writeheader()
                writer.writerows(rows)
    console.print(table(rows))


def trained(variant: str, seed: int, task: str, demos: Path, time_budget: str) -> dict[str, str]:
    """One run and its policy's return."""
    config = VARIANTS[variant](DRAWN)
    config = replace(config, threads=1, tensorboard=False, evaluation=replace(config.evaluation, every=10**9))
    budget = parse_duration(time_budget)
    with tempfile.TemporaryDirectory() as directory:
        run = Run(
            RunConfig(task, "bootifol", "drawn", seed, str(demos), budget, config),
            Path(directory),
            Console(quiet=True),
        )
        if not run.learn():
            raise SystemExit("interrupted; the same command goes on with this run")
        agent, counters = run.components.agent, run.counters
    act: Act = lambda observation: agent.act(observation, 0, explore=False)  # noqa: E731
    described = task_named(task)
    environment = make_environment(task, config.pictures, described.evaluation_steps)
    results = evaluate(environment, act, evaluation_seeds(seed, EPISODES))
    mean = float(np.mean([result.environment_return for result in results]))
    scaled = scaled_return(mean, expert_return=described.expert_return, random_return=described.random_return)
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
    main()
