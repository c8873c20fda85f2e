"""One run on a page: its learning curve, the learned reward along episodes from one start, and their film strips.

    python -m benchmarks.figure_run runs/reacher_hard --out docs/images/reacher_hard_policy.png

The start is the first of the run's showcase, so that nobody chose it by how it went; `--start` shows another.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.figure_command import figure_parser, write_figure
from bootifol.errors import BootifolError
from bootifol.reports.film_strip import run_figure
from bootifol.reports.run_files import RunFiles


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    if len(runs) > 1:
        raise BootifolError(f"the figure shows one run, and there are {len(runs)}; give the directory of one")
    return run_figure(runs[0], arguments.start), []


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    parser = figure_parser(__doc__)
    parser.add_argument("--start", type=int, default=0, help="which start of the showcase, from 0")
    write_figure(parser, draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
