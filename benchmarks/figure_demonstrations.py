"""Figures 3 and 9 of the paper: film strips of the expert above the agent, from the same start.

    python -m benchmarks.figure_demonstrations runs/hopper_stand/bootifol/seed1 runs/drawer_close/bootifol/seed1 \\
        --out docs/images/demonstrations.png

The start is the first of the run's showcase, so that nobody chose it by how it went; `--start` shows another.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.figure_command import figure_parser, write_figure
from bootifol.reports.film_strip import expert_above_agent
from bootifol.reports.run_files import RunFiles


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    return expert_above_agent(runs, arguments.start), []


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    parser = figure_parser(__doc__)
    parser.add_argument("--start", type=int, default=0, help="which start of the showcase, from 0")
    write_figure(parser, draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
