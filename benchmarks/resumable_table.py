"""A CSV file of measurements that take long: each row is written as soon as it is known, and none is measured twice."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.table import Table

from bootifol.errors import BootifolError
from bootifol.files import written_aside


class ResumableTable:
    """Rows of text in a CSV file.

    Args:
        path: of the file, which is gone on with if it is there.
        columns: of the file.
        key: how many of them, the first, tell rows apart.

    Raises:
        BootifolError: the file has other columns.
    """

    def __init__(self, path: Path, columns: Sequence[str], key: int = 2) -> None:
        self.path = path
        self.columns = tuple(columns)
        self.rows: list[dict[str, str]] = []
        self._key = key
        if path.exists():
            with path.open(newline="") as file:
                reader = csv.DictReader(file)
                self.rows = list(reader)
            if tuple(reader.fieldnames or ()) != self.columns:
                raise BootifolError(
                    f"{path} is another table: its first line must be {','.join(columns)}; choose another --out"
                )

    def has(self, *key: object) -> bool:
        """Whether a row begins with these values."""
        wanted = [str(value) for value in key]
        return any([row[column] for column in self.columns[: self._key]] == wanted for row in self.rows)

    def add(self, row: Mapping[str, str]) -> None:
        """Adds a row and writes the file."""
        self.rows.append({column: row[column] for column in self.columns})
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with written_aside(self.path) as aside, aside.open("w", newline="") as file:
            writer = csv.DictWriter(file, self.columns)
            writer.writeheader()
            writer.writerows(self.rows)

    def shown(self) -> Table:
        """For a terminal."""
        table = Table(*self.columns)
        for row in self.rows:
            table.add_row(*row.values())
        return table
