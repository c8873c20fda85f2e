"""Figure 8 of the paper: L_Z, L_seq, L_ae and L_triplet during the Alignment Phase.

    python -m benchmarks.figure_alignment_losses runs/reacher_hard --out docs/images/alignment_losses.png

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
from bootifol.reports.run_files import ALIGNMENT, RunFiles

LOSSES = (
    Loss(r"$\mathcal{L}_Z$", ("loss/prediction",)),
    Loss(r"$\mathcal{L}_{seq} = \mathcal{L}_Z + \mathcal{L}_O$", ("loss/prediction", "loss/sequence")),
    Loss(r"$\mathcal{L}_{ae}$", ("loss/autoencoder",)),
    Loss(r"$\mathcal{L}_{triplet}$", ("loss/triplet",)),
)


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    comparison = compare(runs, unfinished=True)
    return losses_figure(comparison, ALIGNMENT, LOSSES), comparison.notes


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    write_figure(figure_parser(__doc__), draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
