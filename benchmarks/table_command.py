"""What the commands of the paper's tables share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from bootifol.reports.paper_results import PaperTable
from bootifol.reports.table_files import table


def write_table(description: str | None, paper: PaperTable, arguments: Sequence[str] | None = None) -> None:
    """Prints a table of the paper from runs, and writes it on request.

    Raises:
        BootifolError: there are no such runs, or no table can be made of them.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "runs", type=Path, nargs="+", help="directories that `bootifol train` wrote, or that hold some"
    )
    parser.add_argument("--out", type=Path, help="a file that ends in .md, .tex or .csv")
    parsed = parser.parse_args(arguments)
    print(table(parsed.runs, parsed.out, tuple(paper.tasks)), end="")
