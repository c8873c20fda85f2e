"""Tables that are gone on with."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.resumable_table import ResumableTable

from bootifol.errors import BootifolError

COLUMNS = ("variant", "seed", "mean_return")


def test_a_table_is_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "results" / "cloning.csv"
    table = ResumableTable(path, COLUMNS)
    assert not table.has("preset, twice", 1)
    table.add({"mean_return": "3.5", "variant": "preset, twice", "seed": "1"})
    again = ResumableTable(path, COLUMNS)
    assert again.has("preset, twice", 1) and not again.has("preset, twice", 2)
    again.add({"variant": "preset, twice", "seed": "2", "mean_return": "4.0"})
    assert path.read_text().splitlines() == [
        "variant,seed,mean_return",
        '"preset, twice",1,3.5',
        '"preset, twice",2,4.0',
    ]


def test_a_row_that_lacks_a_column_is_not_written(tmp_path: Path) -> None:
    table = ResumableTable(tmp_path / "table.csv", COLUMNS)
    with pytest.raises(KeyError):
        table.add({"variant": "preset"})
    assert not (tmp_path / "table.csv").exists()


def test_another_table_is_refused(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("task,seconds\nreacher_hard,3\n")
    with pytest.raises(BootifolError, match="its first line should be variant,seed,mean_return"):
        ResumableTable(tmp_path / "table.csv", COLUMNS)
