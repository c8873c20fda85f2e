"""Result tables of benchmarks: CSV files that are always whole."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from bootifol.errors import BootifolError
from bootifol.files import written_aside

Row = dict[str, str]


def read_rows(path: Path, columns: Sequence[str]) -> list[Row]:
    """The rows of a table, none where there is no file yet.

    Raises:
        BootifolError: the file is another table.
    """
    if not path.exists():
        return []
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        if list(reader.fieldnames or []) != list(columns):
            raise BootifolError(
                f"{path} is another table: its first line should be {','.join(columns)}; move it away or choose "
                "another --out"
            )
        return list(reader)


def write_rows(path: Path, columns: Sequence[str], rows: Sequence[Row]) -> None:
    """Writes a table whole or not at all."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with written_aside(path) as aside:
        aside.write_text(text.getvalue())
