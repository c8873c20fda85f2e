"""Does every method pass the learning test? All on one small drawn task, for equal agent steps.

    bootifol demos record --task drawn_home --agent-size 32 --video-size 32 --episodes 150 --out demos/drawn_home
    python -m benchmarks.learning_test --demos demos/drawn_home --runs runs/methods --out results/drawn_home/methods.csv

Writes one row an evaluation (the curves), and beside it a table (.md) and a picture (.png). A seed has passed
where its policy reaches the 0.6 of the expert's return that the test suite asks of bootifol. Seeds are the outer loop.
Finished runs are kept and interrupted ones resumed: the same command goes on where it stopped.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from benchmarks.command import command
from benchmarks.page_modules import ADD_A_METHOD, write_page_modules
from benchmarks.rows import Row, markdown, read_rows, write_rows
from benchmarks.suites import RANDOM, System, every_system, with_overrides
from bootifol.errors import BootifolError
from bootifol.evaluation.returns import evaluate, scaled_return
from bootifol.evaluation.summary import Summary, summarize
from bootifol.evaluation.tables import read_evaluations
from bootifol.experts import make_random
from bootifol.files import written_aside
from bootifol.presets import preset
from bootifol.reports.style import KIND_COLORS, RUN_COLORS, RUN_DASHES, house_style, save_png
from bootifol.tasks import Task, task_named
from bootifol.training.components import build_environment
from bootifol.training.config import TrainingConfig
from bootifol.training.interactive import evaluation_seeds
from bootifol.training.run_config import RunConfig
from bootifol.training.train import Run

PASSING = 0.6
"""Share of the expert's return that tests/end_to_end/test_learning.py asks for."""

OPTIMAL_TRANSPORT = System("optimal_transport:OptimalTransport")
"""The method that docs/add_a_method.md adds, at sizes of its own."""

COLUMNS = ("method", "seed", "agent_steps", "seconds", "episodes", "mean_return", "scaled_return")


@command(resumes=True)
def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--methods", nargs="+", help="some of the systems of the suites, or optimal_transport"
    )
    parser.add_argument("--own", nargs="+", default=[], help="more methods, as MODULE:NAME")
    parser.add_argument("--task", default="drawn_home")
    parser.add_argument("--preset", default="drawn")
    parser.add_argument("--agent-steps", type=int, help="instead of the preset's")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--demos", type=Path, required=True)
    parser.add_argument("--runs", type=Path, required=True, help="where to keep the runs")
    parser.add_argument("--out", type=Path, default=Path("results/drawn_home/methods.csv"))
    arguments = parser.parse_args(words)
    compare(arguments)


def compare(arguments: argparse.Namespace) -> None:
    """Trains what is missing, and writes rows, table and picture."""
    write_page_modules(ADD_A_METHOD, arguments.runs)
    sys.path.insert(0, str(arguments.runs.resolve()))
    config = _configuration(arguments.preset, arguments.agent_steps)
    chosen = _chosen(arguments, config)
    console = Console()
    rows = read_rows(arguments.out, COLUMNS)
    done = {(row["method"], row["seed"]) for row in rows}
    for seed in arguments.seeds:
        for method, system in chosen.items():
            described = described_run(arguments, config, system, seed)
            directory = arguments.runs / f"{method.replace(':', '.')}-seed{seed}"
            if (directory / "config.json").exists() and RunConfig.read(directory) != described:
                raise BootifolError(f"{directory} holds another run: choose another --runs and another --out")
            if (method, str(seed)) in done:
                continue
            if method == RANDOM:
                rows += random_rows(described)
            else:
                rows += trained_rows(described, method, directory)
            console.print(rows[-1])
            write_rows(arguments.out, COLUMNS, rows)
    task = task_named(arguments.task)
    shown = table(rows, task)
    with written_aside(arguments.out.with_suffix(".md")) as aside:
        aside.write_text(shown)
    draw_curves(rows, task, arguments.out.with_suffix(".png"))
    console.print(shown, highlight=False, soft_wrap=True)


def _configuration(preset_name: str, agent_steps: int | None) -> TrainingConfig:
    config = preset(preset_name)
    evaluation = replace(config.evaluation, episodes=0, showcase_episodes=0)
    if agent_steps is not None:
        config = replace(config, interactive=replace(config.interactive, agent_steps=agent_steps))
    return replace(config, evaluation=evaluation, threads=1, tensorboard=False)


def systems(config: TrainingConfig, task: str) -> dict[str, System]:
    """All that can take part on a task, by name: what the suites compare, and the page's own method."""
    compared = [system for system in every_system(config, timed=False) if system.is_compared_on(task)]
    return {**{system.name: system for system in compared}, "optimal_transport": OPTIMAL_TRANSPORT}


def _chosen(arguments: argparse.Namespace, config: TrainingConfig) -> dict[str, System]:
    known = systems(config, arguments.task)
    names = arguments.methods or list(known)
    for name in names:
        if name not in known:
            raise BootifolError(
                f"there is no system '{name}' on {arguments.task}: choose of {', '.join(known)}"
            )
    return {**{name: known[name] for name in names}, **{own: System(own) for own in arguments.own}}


def described_run(
    arguments: argparse.Namespace, config: TrainingConfig, system: System, seed: int
) -> RunConfig:
    """What a system's run is."""
    config = with_overrides(config, system.overrides)
    return RunConfig(
        arguments.task, system.method, arguments.preset, seed, str(arguments.demos), None, config
    )


def trained_rows(described: RunConfig, method: str, directory: Path) -> list[Row]:
    """Trains a method, or goes on with it, and gives its evaluations of the task's evaluation length."""
    run = Run(described, directory, Console(quiet=True))
    described.write(directory, ["python", "-m", "benchmarks.learning_test"])
    if not run.learn():
        raise KeyboardInterrupt  # Ctrl-C, which the run itself answers with a checkpoint
    run.finish()
    evaluated = [
        row
        for row in read_evaluations(directory / "evaluations.csv").rows
        if row.episode_steps == run.task.evaluation_steps
    ]
    return [
        row_of(
            run.task,
            method,
            described.seed,
            agent_steps,
            max(row.seconds for row in evaluated if row.agent_steps == agent_steps),
            [row.environment_return for row in evaluated if row.agent_steps == agent_steps],
        )
        for agent_steps in dict.fromkeys(row.agent_steps for row in evaluated)
    ]


def random_rows(described: RunConfig) -> list[Row]:
    """What random actions return, from the same starts as the others' last evaluation."""
    task = described.resolved_task()
    environment = build_environment(described, task.evaluation_steps)
    seeds = evaluation_seeds(described.seed, described.training.evaluation.final_episodes)
    results = evaluate(environment, make_random(environment, described.seed), seeds)
    environment.close()
    return [row_of(task, RANDOM, described.seed, 0, 0.0, [result.environment_return for result in results])]


def row_of(
    task: Task, method: str, seed: int, agent_steps: int, seconds: float, returns: Sequence[float]
) -> Row:
    """One evaluation as a line of the table."""
    mean = float(np.mean(returns))
    scaled = scaled_return(mean, expert_return=task.expert_return, random_return=task.random_return)
    if scaled is None:
        raise BootifolError(
            f"{task.name} has no measured returns to compare with: choose a task of the catalogue"
        )
    values = (
        method,
        str(seed),
        str(agent_steps),
        f"{seconds:.0f}",
        str(len(returns)),
        f"{mean:.2f}",
        f"{scaled:.3f}",
    )
    return dict(zip(COLUMNS, values, strict=True))


def last_rows(rows: Sequence[Row], method: str) -> list[Row]:
    """The last evaluation of each seed."""
    by_seed: dict[str, Row] = {}
    for row in rows:
        if row["method"] == method:
            earlier = by_seed.get(row["seed"], row)
            by_seed[row["seed"]] = max(earlier, row, key=lambda each: int(each["agent_steps"]))
    return list(by_seed.values())


def table(rows: Sequence[Row], task: Task) -> str:
    """Returns after training, means over seeds with 95 % bootstrap intervals over them, in Markdown."""
    header = (
        *("method", "seeds", "agent steps", "minutes"),
        *("return", "scaled return", "95 % interval", "passed"),
    )
    lines = []
    for method in dict.fromkeys(row["method"] for row in rows):
        last = last_rows(rows, method)
        scaled = summarize([float(row["scaled_return"]) for row in last])
        steps, seconds, mean = (
            float(np.mean([float(row[column]) for row in last]))
            for column in ("agent_steps", "seconds", "mean_return")
        )
        passed = sum(float(row["mean_return"]) > PASSING * (task.expert_return or np.inf) for row in last)
        cells = (
            method,
            str(len(last)),
            f"{steps:,.0f}",
            f"{seconds / 60:.1f}",
            f"{mean:.1f}",
            f"{scaled.mean:.2f}",
            _interval(scaled),
            f"{passed} of {len(last)}",
        )
        lines.append(cells)
    return markdown(header, lines) + "\n"


def _interval(summary: Summary) -> str:
    return "–" if summary.interval is None else "{:.2f} … {:.2f}".format(*summary.interval)


def draw_curves(rows: Sequence[Row], task: Task, path: Path) -> None:
    """Scaled return by agent steps: thin lines are seeds, thick ones their mean; random actions are dotted."""
    with house_style():
        figure = Figure(figsize=(8.2, 3.8), layout="constrained", dpi=120)
        axes = figure.subplots()
        methods = dict.fromkeys(row["method"] for row in rows if row["method"] != RANDOM)
        for number, method in enumerate(methods):
            color = RUN_COLORS[number % len(RUN_COLORS)]
            dashes = RUN_DASHES[number // len(RUN_COLORS) % len(RUN_DASHES)]
            of_method = [row for row in rows if row["method"] == method]
            by_steps: dict[int, list[float]] = {}
            for row in of_method:
                by_steps.setdefault(int(row["agent_steps"]), []).append(float(row["scaled_return"]))
            for seed in dict.fromkeys(row["seed"] for row in of_method):
                points = sorted(
                    (int(row["agent_steps"]), float(row["scaled_return"]))
                    for row in of_method
                    if row["seed"] == seed
                )
                axes.plot(*zip(*points, strict=True), color=color, linestyle=dashes, linewidth=0.6, alpha=0.5)
            steps = sorted(by_steps)
            means = [float(np.mean(by_steps[step])) for step in steps]
            axes.plot(steps, means, color=color, linestyle=dashes, label=method)
        if random := last_rows(rows, RANDOM):
            level = float(np.mean([float(row["scaled_return"]) for row in random]))
            axes.axhline(level, color=KIND_COLORS["random"], linestyle=":", linewidth=1.2, label=RANDOM)
        axes.axhline(1.0, color=KIND_COLORS["expert"], linewidth=1.0, linestyle=":", label="expert")
        axes.set_xlabel("agent steps")
        axes.set_ylabel("scaled return")
        axes.set_title(
            f"{task.name}: thick lines are means over seeds, thin ones seeds", loc="left", fontsize=9
        )
        axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
    save_png(figure, path)


if __name__ == "__main__":
    raise SystemExit(main())
