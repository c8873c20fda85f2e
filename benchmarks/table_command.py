"""What the commands of the paper's tables share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from bootifol.errors import BootifolError
from bootifol.reports.paper_results import PaperTable
from bootifol.reports.table_files import table


def write_table(description: str | None, paper: PaperTable, arguments: Sequence[str] | None = None) -> int:
    """Prints a table of the paper from runs, and writes it on request.

    Returns:
        The exit code: 0, or 2 after bad input, which one sentence explains.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "runs", type=Path, nargs="+", help="directories that `bootifol train` wrote, or that hold some"
    )
    parser.add_argument("--out", type=Path, help="a file that ends in .md, .tex or .csv")
    parsed = parser.parse_args(arguments)
    try:
        print(table(parsed.runs, parsed.out, tuple(paper.tasks)), end="")
    except BootifolError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0
