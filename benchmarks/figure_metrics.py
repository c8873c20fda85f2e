"""Any metrics of some runs while the agent acts, beside their returns: a panel each, a line a run, nothing averaged.

    python -m benchmarks.figure_metrics runs/gaifo-seed1 runs/gaifo-seed2 \\
      --metrics episode/learned_reward discriminator/accuracy --out docs/images/gaifo.png

Means over seeds hide what swings at another time in each. Runs in progress will do.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.figure_command import figure_parser, write_figure
from bootifol.errors import BootifolError
from bootifol.reports.plots import draw_return_curves, looks_of
from bootifol.reports.run_files import INTERACTIVE, RunFiles
from bootifol.reports.style import agent_step_axis, house_style


def draw(runs: list[RunFiles], arguments: argparse.Namespace) -> tuple[Figure, Sequence[str]]:
    for name in arguments.metrics:
        if not any(run.curve(INTERACTIVE, name) for run in runs):
            logged = sorted({name for run in runs for phase, name in run.curves if phase == INTERACTIVE})
            raise BootifolError(f"no run has logged {name}; choose of {', '.join(logged) or 'none'}")
    looks = looks_of(runs)
    notes = []
    with house_style():
        panels = len(arguments.metrics) + 1
        figure = Figure(figsize=(3.5 * panels, 2.9), layout="constrained", dpi=120)
        returns, *others = figure.subplots(1, panels)
        if not draw_return_curves(returns, looks, scaled=True):
            notes.append("no run has scaled returns yet")
        returns.set_title("return: 0 random, 1 the expert", loc="left", fontsize=9)
        returns.set_ylabel("")
        for axes, name in zip(others, arguments.metrics, strict=True):
            for look in looks:
                if (curve := look.run.curve(INTERACTIVE, name)) is None:
                    notes.append(f"{look.run.path} has not logged {name}")
                    continue
                axes.plot(curve.steps, curve.values, color=look.color, linestyle=look.dashes)
            axes.set_title(name, loc="left", fontsize=9)
            agent_step_axis(axes)
        if len(runs) > 1:
            lines, labels = returns.get_legend_handles_labels()
            figure.legend(lines, labels, loc="outside lower center", ncols=min(len(runs), 6))
    return figure, notes


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    parser = figure_parser(__doc__)
    parser.add_argument("--metrics", nargs="+", required=True, help="as metrics.jsonl names them")
    write_figure(parser, draw, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
