from pathlib import Path

import pytest
from benchmarks.rows import read_rows, write_rows

from bootifol.errors import BootifolError


def test_rows_read_back_as_they_were_written(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "table.csv"
    assert read_rows(path, ("task", "note")) == []
    rows = [{"task": "a", "note": "one, two"}, {"task": "b", "note": ""}]
    write_rows(path, ("task", "note"), rows)
    assert read_rows(path, ("task", "note")) == rows
    with pytest.raises(BootifolError, match=r"table.csv is another table: its first line should be task,who"):
        read_rows(path, ("task", "who"))
