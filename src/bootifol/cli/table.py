"""`bootifol table`: the paper's result tables from runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from bootifol.cli.arguments import RunPaths

Tasks = Annotated[
    tuple[str, ...], tyro.conf.arg(metavar="TASK [TASK ...]", help_behavior_hint="(default: all)")
]


def table(runs: RunPaths, out: Path | None = None, tasks: Tasks = ()) -> int:
    """Print the paper's result tables, scaled and absolute, with the returns of your runs beside the paper's.

    Runs that differ in their seed alone share a row. Below the tables stands what was left out (unfinished runs,
    copies) and what is not on equal terms (mixed configurations or versions, unequal budgets).

    Args:
        runs: Directories that `bootifol train` wrote, collections of results, or directories that hold some.
        out: A file to write besides; its ending says how: .md (Markdown), .tex (LaTeX) or .csv.
        tasks: The only ones to show, such as reacher_hard hopper_stand.
    """
    from bootifol.reports.table_files import table as write_table

    print(write_table(runs, out, tasks or None), end="")
    if out is not None:
        print(f"\ntable: {out}")
    return 0
