"""What expert, half-good and random performers return in every task of the paper, beside the paper's numbers.

    python -m benchmarks.task_returns --episodes 50 --out results/tasks/returns.csv

Each plays the same starts (seeds 0, 1, …), and nothing is rendered. Three lengths of episodes:

- the evaluation's, 500 agent steps: the returns that results are scaled by;
- a training episode's, 60 agent steps, of the expert: does a video show the task done?
- 500 simulator steps, in Meta-World: its own time limit, and by the returns what the paper seems to have used.

Intervals are 95 % bootstrap intervals of the mean over episodes. What is in the file already is not measured again, so
the same command goes on where it stopped; delete a task's lines to measure it anew. A task without a bundled
expert has a sentence in place of numbers.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.command import command
from benchmarks.rows import Row, read_rows, write_rows
from bootifol.errors import require_at_least
from bootifol.evaluation.returns import EpisodeResult, behavior_results, unseen_environment
from bootifol.evaluation.summary import summarize
from bootifol.experts import Behavior
from bootifol.progress import progress
from bootifol.reports.markdown import markdown_table
from bootifol.reports.paper_results import RETURNS
from bootifol.reports.result_tables import ENDS
from bootifol.tasks import TASKS, Task

META_WORLD_LIMIT = 500
"""Meta-World's own time limit, in simulator steps."""

COLUMNS = (
    *("task", "who", "episode_steps", "episodes"),
    *("mean_return", "return_low", "return_high", "return_std"),
    *("success", "success_low", "success_high", "note"),
)

Measurement = tuple[Behavior, int]
"""Who plays, and the agent steps of an episode."""


def measurements(task: Task) -> list[Measurement]:
    """What is measured in a task."""
    behaviors: tuple[Behavior, ...] = ("expert", "half_good", "random")
    wanted: list[Measurement] = [(behavior, task.evaluation_steps) for behavior in behaviors]
    wanted.append(("expert", task.episode_steps))
    if task.suite == "Meta-World":
        steps = META_WORLD_LIMIT // task.action_repeat
        wanted += [("expert", steps), ("random", steps)]
    return wanted


def measured(task: Task, behavior: Behavior, episode_steps: int, episodes: int) -> Row:
    """One row of the table; a sentence in place of numbers where there is no expert."""
    row = dict.fromkeys(COLUMNS, "") | {
        "task": task.name,
        "who": behavior,
        "episode_steps": str(episode_steps),
        "episodes": str(episodes),
    }
    if behavior != "random" and not task.has_expert:
        return row | {
            "note": f"no expert is bundled yet: train one with bootifol experts train --task {task.name}"
        }
    environment = unseen_environment(task, episode_steps)
    results: list[EpisodeResult] = []
    with progress(f"{task.name}, {behavior}, {episode_steps} steps", episodes) as advance:
        for result in behavior_results(behavior, task, environment, range(episodes)):
            results.append(result)
            advance(1, mean=float(np.mean([result.environment_return for result in results])))
    environment.close()
    returns = [result.environment_return for result in results]
    successes = [float(result.success) for result in results if result.success is not None]
    row |= {"return_std": f"{np.std(returns):.2f}"}
    for (mean, low, high), values in (
        (("mean_return", "return_low", "return_high"), returns),
        (("success", "success_low", "success_high"), successes),
    ):
        if values:
            summary = summarize(values)
            ends = summary.interval or (summary.mean, summary.mean)
            row |= {mean: f"{summary.mean:.6g}", low: f"{ends[0]:.6g}", high: f"{ends[1]:.6g}"}
    return row


def key(row: Row) -> tuple[str, str, str]:
    """What a row is about."""
    return row["task"], row["who"], row["episode_steps"]


def measure_all(tasks: Sequence[Task], episodes: int, out: Path) -> list[Row]:
    """Measures what the file lacks, and writes it after every row.

    Rows of another number of episodes are measured again, and so are those that say that there is no expert.
    """
    rows = {key(row): row for row in read_rows(out, COLUMNS)}
    order = list(TASKS)
    for task in tasks:
        for behavior, steps in measurements(task):
            about = (task.name, behavior, str(steps))
            there = rows.get(about)
            if there is not None and there["mean_return"] and there["episodes"] == str(episodes):
                continue
            rows[about] = measured(task, behavior, steps, episodes)
            write_rows(out, COLUMNS, sorted(rows.values(), key=lambda row: order.index(row["task"])))
    return list(rows.values())


def with_interval(row: Row | None, name: str = "return") -> str:
    """`980.5 (978.2 … 982.4)` for a table in docs, or a dash."""
    mean = "mean_return" if name == "return" else name
    if row is None or not row[mean]:
        return "–"
    digits = 1 if name == "return" else 2
    center, low, high = (float(row[column]) for column in (mean, f"{name}_low", f"{name}_high"))
    return f"{center:.{digits}f} ({low:.{digits}f} … {high:.{digits}f})"


def report(tasks: Sequence[Task], rows: Sequence[Row]) -> str:
    """Markdown: returns beside the paper's, success, returns within Meta-World's own limit, what is missing."""
    found = {key(row): row for row in rows}
    returns, successes, limited = [], [], []
    for task in tasks:
        of_task = {
            behavior: found.get((task.name, behavior, str(task.evaluation_steps)))
            for behavior in ("expert", "half_good", "random")
        }
        name, paper = f"`{task.name}`", RETURNS.get(task.name)
        there = (
            ("–", "–")
            if paper is None
            else (f"{paper[who].absolute:.2f} ± {paper[who].deviation:.2f}" for who in ENDS)
        )
        returns.append([name, *(with_interval(row) for row in of_task.values()), *there])
        short = found.get((task.name, "expert", str(task.episode_steps)))
        successes.append(
            [
                name,
                *(with_interval(row, "success") for row in of_task.values()),
                with_interval(short, "success"),
                with_interval(short),
            ]
        )
        if task.suite == "Meta-World":
            steps = str(META_WORLD_LIMIT // task.action_repeat)
            limited.append(
                [name, *(with_interval(found.get((task.name, who, steps))) for who in ("expert", "random"))]
            )
    parts = [
        markdown_table(
            ["return", "expert", "half-good", "random", "the paper's expert", "its random"], returns
        ),
        markdown_table(
            ["success", "expert", "half-good", "random", "expert, training episode", "its return"], successes
        ),
    ]
    if limited:
        parts.append(
            markdown_table([f"return in {META_WORLD_LIMIT} simulator steps", "expert", "random"], limited)
        )
    names = {task.name for task in tasks}
    notes = dict.fromkeys(
        f"`{row['task']}`: {row['note']}." for row in rows if row["note"] and row["task"] in names
    )
    return "\n\n".join([*parts, *notes])


@command(resumes=True)
def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tasks", nargs="+", default=list(RETURNS), choices=list(TASKS), help="the seven by default"
    )
    parser.add_argument("--episodes", type=int, default=50)
    parser.add_argument("--out", type=Path, default=Path("results/tasks/returns.csv"))
    arguments = parser.parse_args(words)
    require_at_least(1, **{"--episodes": arguments.episodes})
    tasks = [TASKS[name] for name in arguments.tasks]
    print(report(tasks, measure_all(tasks, arguments.episodes, arguments.out)))


if __name__ == "__main__":
    raise SystemExit(main())
