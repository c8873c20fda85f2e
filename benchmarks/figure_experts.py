"""How the bundled experts were trained: returns over the training, beside the trainings that did not get there.

    python -m benchmarks.figure_experts --out docs/images/experts.png

A panel for each task with a trained expert, from the curves that lie beside the experts. A curve in
`results/experts/TASK_WHAT_WAS_DIFFERENT.csv` joins the panel of its task.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.rows import read_rows
from bootifol.errors import BootifolError
from bootifol.experts import BUNDLED
from bootifol.experts.train import COLUMNS
from bootifol.files import read_json
from bootifol.reports.paper_results import RETURNS
from bootifol.reports.style import (
    FAINT,
    KIND_COLORS,
    RUN_COLORS,
    agent_step_axis,
    house_style,
    legend_above,
    save_png,
)

OTHERS = Path("results/experts")


def draw_curve(axes: Axes, path: Path, label: str, color: str, marked: int | None = None) -> None:
    """One training; a dot where the policy was taken from."""
    rows = read_rows(path, COLUMNS)
    steps = [int(row["agent_steps"]) for row in rows]
    returns = [float(row["mean_return"]) for row in rows]
    axes.plot(steps, returns, color=color, label=label)
    if marked is not None:
        axes.plot(marked, returns[steps.index(marked)], "o", color=color)


def draw(bundled: Path, others: Path) -> Figure:
    """The figure.

    Raises:
        BootifolError: no expert lies there.
    """
    tasks = sorted(path.stem for path in bundled.glob("*.json"))
    if not tasks:
        raise BootifolError(
            f"no expert lies in {bundled}: put one there with python -m benchmarks.bundle_expert"
        )
    figure = Figure(figsize=(3.6 * len(tasks), 3.2), layout="constrained")
    for number, task in enumerate(tasks):
        axes = figure.add_subplot(1, len(tasks), number + 1)
        taken = read_json(bundled / f"{task}.json", "the expert's training")["expert"]["agent_steps"]
        draw_curve(
            axes, bundled / f"{task}.csv", "the bundled expert's training", KIND_COLORS["expert"], taken
        )
        for color, path in zip(RUN_COLORS, sorted(others.glob(f"{task}_*.csv")), strict=False):
            draw_curve(axes, path, path.stem.removeprefix(f"{task}_").replace("_", " "), color)
        if task in RETURNS:
            axes.axhline(RETURNS[task]["Expert"].absolute, color=FAINT, ls=":", label="the paper's expert")
        axes.set(title=task, ylim=(0, 1000))
        agent_step_axis(axes)
    figure.axes[0].set_ylabel("mean return")
    legend_above(figure)
    return figure


@command()
def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("docs/images/experts.png"))
    parser.add_argument("--bundled", type=Path, default=BUNDLED)
    parser.add_argument("--others", type=Path, default=OTHERS, help="curves of other trainings")
    arguments = parser.parse_args(argv)
    with house_style():
        save_png(draw(arguments.bundled, arguments.others), arguments.out)
    print(arguments.out)


if __name__ == "__main__":
    raise SystemExit(main())
