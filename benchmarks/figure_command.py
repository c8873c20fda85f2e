"""What the commands of the paper's figures share: runs in, one PNG out, a sentence where something is missing."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from bootifol.reports.collection import read_runs
from bootifol.reports.run_files import RunFiles
from bootifol.reports.style import save_png

Draw = Callable[[list[RunFiles], argparse.Namespace], tuple[Figure, Sequence[str]]]
"""From runs and arguments to a figure and what must be said about it."""


def figure_parser(description: str | None) -> argparse.ArgumentParser:
    """The arguments of every figure: runs and `--out`."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "runs", type=Path, nargs="+", help="directories that `bootifol train` wrote, or that hold some"
    )
    parser.add_argument("--out", type=Path, required=True, help="a PNG file")
    return parser


def write_figure(parser: argparse.ArgumentParser, draw: Draw, arguments: Sequence[str] | None = None) -> None:
    """Reads the runs, draws, writes; prints what must be said about the figure.

    Raises:
        BootifolError: there are no such runs, or the figure cannot be drawn from them.
    """
    parsed = parser.parse_args(arguments)
    figure, notes = draw(read_runs(parsed.runs), parsed)
    save_png(figure, parsed.out)
    for note in notes:
        print(f"- {note}")
    print(f"figure: {parsed.out}")
