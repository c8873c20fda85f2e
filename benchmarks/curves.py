"""One picture of the curves of several runs, for docs: scaled return and learned reward by agent steps and by time.

python -m benchmarks.curves runs/a runs/b --out docs/images/reacher_hard.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.command import command
from bootifol.files import written_aside
from bootifol.reports.plots import draw_return_curves, looks_of
from bootifol.reports.run_files import read_run
from bootifol.reports.style import house_style


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", type=Path, nargs="+", help="directories that `bootifol train` wrote")
    parser.add_argument("--out", type=Path, required=True, help="a PNG file")
    arguments = parser.parse_args()
    looks = looks_of([read_run(directory) for directory in arguments.runs])
    with house_style():
        figure = Figure(figsize=(10.4, 3.4), layout="constrained", dpi=120)
        by_steps, by_time = figure.subplots(1, 2)
        draw_return_curves(by_steps, looks, scaled=True)
        draw_return_curves(by_time, looks, scaled=True, by_time=True)
        by_steps.set_title("0 is a random agent, 1 the expert", loc="left", fontsize=9)
        by_time.legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        with written_aside(arguments.out) as aside:
            figure.savefig(aside, format="png")


if __name__ == "__main__":
    raise SystemExit(main())
