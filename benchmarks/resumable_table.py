"""A CSV file of measurements that take long: each row is written as soon as it is known, and none is measured twice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.table import Table

from benchmarks.rows import Row, read_rows, write_rows


class ResumableTable:
    """Rows of text in a CSV file.

    Args:
        path: of the file, which is gone on with if it is there.
        columns: of the file.
        key: how many of them, the first, tell rows apart.

    Raises:
        BootifolError: the file is another table.
    """

    def __init__(self, path: Path, columns: Sequence[str], key: int = 2) -> None:
        self.path = path
        self.columns = tuple(columns)
        self.rows: list[Row] = read_rows(path, columns)
        self._key = key

    def has(self, *key: object) -> bool:
        """Whether a row begins with these values."""
        wanted = [str(value) for value in key]
        return any([row[column] for column in self.columns[: self._key]] == wanted for row in self.rows)

    def add(self, row: Mapping[str, str]) -> None:
        """Adds a row and writes the file."""
        self.rows.append({column: row[column] for column in self.columns})
        write_rows(self.path, self.columns, self.rows)

    def shown(self) -> Table:
        """For a terminal."""
        table = Table(*self.columns)
        for row in self.rows:
            table.add_row(*row.values())
        return table
