"""Figure 6b of the paper: for how many agent steps the encoders should learn, on Reacher Hard.

    python -m benchmarks.figure_encoder_training runs/encoder_training --out docs/images/encoder_training.png

The paper has `--interactive.reward-updates-until` (N_train) 0, 100000, 375000 and 1550000 of 1550000 agent steps.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.figure_command import figure_parser, write_figure
from bootifol.reports.figures import ablation_figure
from bootifol.reports.run_files import RunFiles, flattened
from bootifol.reports.style import thousands

COMPARED = ("interactive.reward_updates_until",)


def trained_until(run: RunFiles) -> int:
    return int(dict(flattened(run.config)).get("interactive.reward_updates_until", 0))


def variant(run: RunFiles) -> str:
    return f"{thousands(trained_until(run))}-step"


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    return ablation_figure(
        sorted(runs, key=trained_until),
        variant,
        COMPARED,
        "add one with another --interactive.reward-updates-until",
    )


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    write_figure(figure_parser(__doc__), draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
