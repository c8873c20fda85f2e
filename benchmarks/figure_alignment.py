"""Figure 5 of the paper: what the Alignment Phase brings on Reacher Hard.

    python -m benchmarks.figure_alignment runs/alignment --out docs/images/alignment.png

Three variants: with it; without (`--alignment.gradient-steps 0`); without and with a reward that learns until the
run ends (`--interactive.reward-updates-until` as many as `--interactive.agent-steps`).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.figure_command import figure_parser, write_figure
from bootifol.reports.figures import ablation_figure
from bootifol.reports.run_files import RunFiles, flattened

COMPARED = ("alignment.gradient_steps", "interactive.reward_updates_until")


def variant(run: RunFiles) -> str:
    config = dict(flattened(run.config))
    if config.get("alignment.gradient_steps") != "0":
        return "alignment"
    until, steps = (
        int(config.get(f"interactive.{name}", 0)) for name in ("reward_updates_until", "agent_steps")
    )
    return "no-alignment, trained to the end" if until >= steps else "no-alignment"


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    return ablation_figure(
        runs, variant, COMPARED, "add one with and one without --alignment.gradient-steps 0"
    )


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    write_figure(figure_parser(__doc__), draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
