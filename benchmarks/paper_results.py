"""The results that the paper's tables are made of: every evaluation of runs, in one file.

    python -m benchmarks.paper_results results/paper --out results/paper.csv
    python -m benchmarks.paper_results results/paper --out results/paper.csv --figure docs/images/paper_returns.png

from runs, or from a collection of them (`benchmarks.collect`), which also says how each was made.

A row an evaluation: task, system, inferred_actions, cloned, seed, minutes, agent_steps, scaled_return (the mean over
its episodes), and how many episodes there were, of how many steps, of which how many were solved. A system is a method,
with `-sequences` where BootIfOL learns the paper's objective alone, or `cloning`, which hears no reward.
`inferred_actions` is 1 where expert videos with inferred actions were in the agent's batches, and `cloned` where the
policy was pulled to those actions. What each run ended with is printed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from benchmarks.command import command
from benchmarks.rows import Row, write_rows
from bootifol.errors import BootifolError
from bootifol.evaluation.summary import summarize
from bootifol.reports.collection import read_runs
from bootifol.reports.markdown import markdown_table
from bootifol.reports.names import clones, hears_reward, infers_actions, task_title
from bootifol.reports.run_files import RunFiles
from bootifol.reports.style import RUN_COLORS, RUN_DASHES, house_style, require_png, save_png

KEY = ("task", "system", "inferred_actions", "cloned", "seed")
COLUMNS = (*KEY, "minutes", "agent_steps", "scaled_return", "episodes", "episode_steps", "solved")
FINAL_EPISODES = 50
"""An evaluation of fewer episodes is one on the way: a run that has no other is unfinished."""


def system_of(run: RunFiles) -> str:
    """The method, and whether BootIfOL learns from sequences, as in the paper, instead of single frames."""
    if not hears_reward(run):
        return "cloning"
    if run.method != "bootifol":
        return run.method
    reads = run.config.get("reward", {}).get("bootifol", {}).get("reward")
    return "bootifol" if reads == "frames" else "bootifol-sequences"


def in_words(system: str, inferred_actions: str, cloned: str) -> str:
    """A system, and what the videos taught its policy beside the reward."""
    if system == "cloning":
        return system
    return system + (", cloned" if cloned == "1" else ", inferred actions" if inferred_actions == "1" else "")


def rows_of(run: RunFiles) -> list[Row]:
    """A row an evaluation, at the longest episodes that have a scale.

    Raises:
        BootifolError: the run was not evaluated, or its task has no scale.
    """
    lengths = run.episode_lengths(scaled=True)
    if not lengths:
        raise BootifolError(
            f"{run.path} has no evaluation with a scaled return: let it learn until its first one"
        )
    key = (
        run.task,
        system_of(run),
        str(int(infers_actions(run))),
        str(int(clones(run))),
        str(run.seed),
    )
    rows = []
    for agent_steps, episodes in run.evaluations_of(lengths[-1]).items():
        scaled = [row.scaled_return for row in episodes if row.scaled_return is not None]
        values = (
            f"{episodes[0].seconds / 60:.1f}",
            str(agent_steps),
            f"{np.mean(scaled):.4f}",
            str(len(episodes)),
            str(lengths[-1]),
            "" if episodes[0].success is None else str(sum(bool(row.success) for row in episodes)),
        )
        rows.append(dict(zip(COLUMNS, (*key, *values), strict=True)))
    return rows


def all_rows(paths: Sequence[Path]) -> list[Row]:
    """Those of all runs, by task, system and seed.

    Raises:
        BootifolError: two runs are of one task, system and seed.
    """
    rows: list[Row] = []
    seen: dict[tuple[str, ...], Path] = {}
    for run in read_runs(paths):
        new = rows_of(run)
        key = tuple(new[0][column] for column in KEY)
        if key in seen:
            raise BootifolError(
                f"{run.path} and {seen[key]} are both {' '.join(key)}: give one of them, or keep them in two files"
            )
        seen[key] = run.path
        rows += new
    return sorted(
        rows,
        key=lambda row: (*(row[column] for column in KEY[:-1]), int(row["seed"]), int(row["agent_steps"])),
    )


def grouped(rows: Sequence[Row], columns: Sequence[str]) -> dict[tuple[str, ...], list[Row]]:
    """Rows that have the same values there, in their order."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[column] for column in columns), []).append(row)
    return groups


def table(rows: Sequence[Row]) -> str:
    """A row a task and system, in Markdown: where each seed ended, and their mean. What is unfinished is called so."""
    cells = []
    for (task, *system), of_system in grouped(rows, KEY[:-1]).items():
        ends = [of_seed[-1] for of_seed in grouped(of_system, ("seed",)).values()]
        finished = [row for row in ends if int(row["episodes"]) >= FINAL_EPISODES]
        scores = [float(row["scaled_return"]) for row in finished]
        summary = summarize(scores) if scores else None
        interval = (
            f" ({summary.interval[0]:.2f} … {summary.interval[1]:.2f})"
            if summary and summary.interval
            else ""
        )
        unfinished = [
            f"{float(row['scaled_return']):.2f} at {int(row['agent_steps']):,}"
            for row in ends
            if row not in finished
        ]
        cells.append(
            (
                task_title(task),
                in_words(*system),
                f"{summary.mean:.2f}{interval}" if summary else "–",
                ", ".join(f"{score:.2f}" for score in scores) or "–",
                ", ".join(unfinished) or "–",
                f"{np.mean([float(row['minutes']) for row in ends]):.0f}",
                f"{max(int(row['agent_steps']) for row in ends):,}",
            )
        )
    header = (
        "task",
        "system",
        "mean (95 % over seeds)",
        "seeds",
        "unfinished",
        "minutes",
        "agent steps",
    )
    return markdown_table(header, cells)


def drawn(rows: Sequence[Row]) -> Figure:
    """Scaled returns over agent steps above, over minutes below; a column a task, a line a seed, a color a system."""
    tasks = list(grouped(rows, ("task",)))
    systems = list(grouped(rows, KEY[1:-1]))
    with house_style():
        figure = Figure(figsize=(2.4 * len(tasks), 4.4), dpi=150, layout="constrained")
        axes = figure.subplots(2, len(tasks), sharey=True, squeeze=False)
        for (task, *system, _), of_seed in grouped(rows, KEY).items():
            column, place = tasks.index((task,)), systems.index(tuple(system))
            for line, unit in enumerate(("agent_steps", "minutes")):
                axes[line, column].plot(
                    [float(row[unit]) / (1000 if line == 0 else 1) for row in of_seed],
                    [float(row["scaled_return"]) for row in of_seed],
                    color=RUN_COLORS[place % len(RUN_COLORS)],
                    linestyle=RUN_DASHES[place % len(RUN_DASHES)],
                    linewidth=1.0,
                )
        for column, (task,) in enumerate(tasks):
            axes[0, column].set_title(task_title(task), fontsize=9)
            axes[0, column].set_xlabel("thousand agent steps")
            axes[1, column].set_xlabel("minutes of wall-clock")
            for panel in axes[:, column]:
                panel.axhline(1.0, color="#7A7F87", linewidth=0.8)
        for line in range(2):
            axes[line, 0].set_ylabel("scaled return")
        names = [in_words(*system) for system in systems]
        handles = [
            axes[0, 0].plot(
                [], [], color=RUN_COLORS[i % len(RUN_COLORS)], linestyle=RUN_DASHES[i % len(RUN_DASHES)]
            )[0]
            for i in range(len(systems))
        ]
        figure.legend(handles, names, loc="outside lower center", ncols=len(names))
        return figure


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", type=Path, nargs="+", help="run directories, collections, or what holds some")
    parser.add_argument("--out", type=Path, required=True, help="the CSV file")
    parser.add_argument("--figure", type=Path, help="PNG of the learning curves")
    options = parser.parse_args(arguments)
    if options.figure:
        require_png(options.figure)
    rows = all_rows(options.runs)
    write_rows(options.out, COLUMNS, rows)
    if options.figure:
        save_png(drawn(rows), options.figure)
    Console(width=160).print(table(rows))


if __name__ == "__main__":
    raise SystemExit(main())
