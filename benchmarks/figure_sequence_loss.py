"""Figure 7 of the paper: L_seq during the Interactive Phase, and L_O, the part of it that tells expert from agent.

    python -m benchmarks.figure_sequence_loss runs/reacher_hard --out docs/images/sequence_loss.png

L_seq is the sum of L_Z and L_O, as in the paper, whatever the weights of a run. Runs in progress will do.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.figure_command import figure_parser, write_figure
from bootifol.reports.comparison import compare
from bootifol.reports.figures import Loss, losses_figure
from bootifol.reports.run_files import INTERACTIVE, RunFiles

LOSSES = (
    Loss(r"$\mathcal{L}_{seq} = \mathcal{L}_Z + \mathcal{L}_O$", ("loss/prediction", "loss/sequence")),
    Loss(r"$\mathcal{L}_O$", ("loss/sequence",)),
)


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    comparison = compare(runs, unfinished=True)
    return losses_figure(comparison, INTERACTIVE, LOSSES), comparison.notes


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    write_figure(figure_parser(__doc__), draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
