"""Figure 6a of the paper: a policy on pictures against one on the reward's encodings of them, on Reacher Hard.

python -m benchmarks.figure_encoding_based runs/encoding_based --out docs/images/encoding_based.png
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.figure_command import figure_parser, write_figure
from bootifol.reports.figures import ablation_figure
from bootifol.reports.run_files import RunFiles, flattened

FIELD = "agent.observations"
"""What the policy sees; runs from before there was a choice saw pictures."""

NAMES = {"pictures": "image-based", "encodings": "encoding-based"}


def variant(run: RunFiles) -> str:
    seen = dict(flattened(run.config)).get(FIELD, "pictures")
    return NAMES.get(seen, seen)


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    return ablation_figure(runs, variant, (FIELD,), "add one of the other kind (--agent.observations)")


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    write_figure(figure_parser(__doc__), draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
