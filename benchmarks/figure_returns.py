"""Figure 4 of the paper: average return while agents learn, of all methods, a panel a task.

    python -m benchmarks.figure_returns runs/reacher_hard runs/hopper_stand --out docs/images/returns.png

Mean over seeds, with 95 % bootstrap intervals. Unfinished runs are left out and named.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.figure_command import figure_parser, write_figure
from bootifol.reports.comparison import compare
from bootifol.reports.figures import returns_figure
from bootifol.reports.names import LEARN_NOTHING
from bootifol.reports.run_files import RunFiles


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    comparison = compare([run for run in runs if run.method not in LEARN_NOTHING])
    left_out = [
        f"{run.path} learns nothing, so it has no curve." for run in runs if run.method in LEARN_NOTHING
    ]
    return returns_figure(comparison, arguments.by_time, arguments.scaled), [*comparison.notes, *left_out]


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    parser = figure_parser(__doc__)
    parser.add_argument("--by-time", action="store_true", help="over wall-clock time instead of agent steps")
    parser.add_argument("--scaled", action="store_true", help="0 for random actions, 1 for the expert")
    write_figure(parser, draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
