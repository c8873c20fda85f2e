"""The result tables of a run, `evaluations.csv` and `ranking.csv`, and the one of `bootifol evaluate --out`.

Every write leaves a whole file (written aside, then renamed). Rows measured again at the same agent steps
replace the old ones, so a run that resumes from a checkpoint repeats its evaluations without doubling them. A table of
many runs (`write_by_run`) has their names in a first column.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, Generic, TypeVar

from bootifol.errors import BootifolError
from bootifol.files import require_file, written_aside


@dataclass(frozen=True)
class EvaluationRow:
    """One evaluation episode."""

    agent_steps: int
    """Agent steps of training when it was played."""

    seconds: float
    """Wall-clock seconds of training when it was played."""

    episode_steps: int
    """Length of the episode in agent steps (60 for curves, 500 for tables)."""

    episode: int
    """Number of the episode within its evaluation, from 0."""

    seed: int
    """The seed of its start."""

    environment_return: float
    """Sum of the environment's own rewards."""

    scaled_return: float | None
    """0 for a random agent, 1 for the expert, unclipped; None where the task has no measured levels."""

    success: bool | None
    """Whether the task was solved, where it says so."""


@dataclass(frozen=True)
class PlayedRow(EvaluationRow):
    """One episode that `bootifol evaluate` played."""

    run: str
    """Directory of the run, as it was named."""


@dataclass(frozen=True)
class RankingRow:
    """The learned reward of one video."""

    agent_steps: int
    """Agent steps of training when it was measured; 0 is right after alignment."""

    kind: str
    """What the video shows: expert, half_good, random or agent."""

    video: str
    """Name of the video."""

    reward: float
    """The learned reward summed over the video."""


@dataclass(frozen=True)
class MetricRow:
    """One value that a run logged."""

    phase: str
    """Of the run: alignment, cloning or interactive."""

    step: int
    """As the phase counts."""

    name: str
    """Of the metric."""

    value: float


RUN = "run"
"""First column of a table of many runs."""

Row = TypeVar("Row", EvaluationRow, RankingRow, MetricRow)

Measured = TypeVar("Measured", EvaluationRow, RankingRow)
"""Rows of one moment, which are measured and replaced together."""

Item = TypeVar("Item")


@dataclass(frozen=True)
class Table(Generic[Item]):
    """What a table file holds."""

    rows: list[Item]
    damaged_lines: list[int]
    """Numbers of the lines (the header is 1) that could not be read, such as one cut by a crash."""


def append_evaluations(path: Path, rows: Sequence[EvaluationRow]) -> None:
    """Adds rows to `evaluations.csv`; older rows of the same agent steps and episode length are replaced."""
    replaced = {(row.agent_steps, row.episode_steps) for row in rows}
    earlier = _rows_so_far(path, EvaluationRow)
    kept = [row for row in earlier if (row.agent_steps, row.episode_steps) not in replaced]
    _write(path, EvaluationRow, _sorted([*kept, *rows]))


def append_ranking(path: Path, rows: Sequence[RankingRow]) -> None:
    """Adds rows to `ranking.csv`; older rows of the same agent steps are replaced."""
    replaced = {row.agent_steps for row in rows}
    kept = [row for row in _rows_so_far(path, RankingRow) if row.agent_steps not in replaced]
    _write(path, RankingRow, _sorted([*kept, *rows]))


def write_played(path: Path, rows: Sequence[PlayedRow]) -> None:
    """Writes episodes of one run or several; an older file is replaced."""
    _write(path, PlayedRow, rows)


def drop_later_rows(run_dir: Path, agent_steps: int) -> None:
    """Removes what `evaluations.csv` and `ranking.csv` measured after so many agent steps.

    A run that goes on from a checkpoint may never come to those moments again: with a time budget it ends elsewhere.
    """
    _drop_later_rows(run_dir / "evaluations.csv", EvaluationRow, agent_steps)
    _drop_later_rows(run_dir / "ranking.csv", RankingRow, agent_steps)


def read_evaluations(path: Path) -> Table[EvaluationRow]:
    """Reads `evaluations.csv`.

    Raises:
        BootifolError: the file is missing, or its columns are not those of `EvaluationRow`.
    """
    return _read(path, EvaluationRow)


def read_ranking(path: Path) -> Table[RankingRow]:
    """Reads `ranking.csv`.

    Raises:
        BootifolError: the file is missing, or its columns are not those of `RankingRow`.
    """
    return _read(path, RankingRow)


def write_by_run(path: Path, row_type: type[Row], rows: Sequence[tuple[str, Row]]) -> None:
    """Writes the rows of many runs, each with the name of its run, which becomes the first column `run`."""
    _write_lines(path, [RUN, *_columns(row_type)], [_texts(row, name) for name, row in rows])


def read_by_run(path: Path, row_type: type[Row]) -> Table[tuple[str, Row]]:
    """Reads a table of `write_by_run`: each row with the name of its run.

    Raises:
        BootifolError: the file is missing, or its columns are others.
    """
    pairs: list[tuple[str, Row] | None] = []
    for line in _read_lines(path, [RUN, *_columns(row_type)]):
        row = _parsed(row_type, line[1:])
        pairs.append(None if row is None else (line[0], row))
    return _table(pairs)


def _drop_later_rows(path: Path, row_type: type[Measured], agent_steps: int) -> None:
    rows = _rows_so_far(path, row_type)
    kept = [row for row in rows if row.agent_steps <= agent_steps]
    if len(kept) < len(rows):
        _write(path, row_type, kept)


def _rows_so_far(path: Path, row_type: type[Measured]) -> list[Measured]:
    return _read(path, row_type).rows if path.exists() else []


def _sorted(rows: Sequence[Measured]) -> list[Measured]:
    """By agent steps: a re-measured evaluation takes the place of the one it replaces."""
    return sorted(rows, key=lambda row: row.agent_steps)


def _write(path: Path, row_type: type[Row], rows: Sequence[Row]) -> None:
    _write_lines(path, _columns(row_type), map(_texts, rows))


def _write_lines(path: Path, columns: Sequence[str], lines: Iterable[Sequence[str]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(lines)
    with written_aside(path) as aside:
        aside.write_text(text.getvalue())


def _read(path: Path, row_type: type[Row]) -> Table[Row]:
    return _table(_parsed(row_type, line) for line in _read_lines(path, _columns(row_type)))


def _table(rows: Iterable[Item | None]) -> Table[Item]:
    """Of rows, where None stands for a line that could not be read."""
    numbered = list(enumerate(rows, start=2))
    return Table(
        [row for _, row in numbered if row is not None], [line for line, row in numbered if row is None]
    )


def _read_lines(path: Path, columns: Sequence[str]) -> list[list[str]]:
    """The lines below the header, as texts."""
    try:
        require_file(path, "the table")
        lines = list(csv.reader(io.StringIO(path.read_text())))
    except FileNotFoundError:
        raise BootifolError(f"the table is missing: there is no {path}") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BootifolError(f"the table cannot be read: {path}: {error}") from error
    if not lines or lines[0] != columns:
        raise BootifolError(
            f"{path} is not a table of this program: its first line must be {','.join(columns)}; "
            "move the file away to start a new one"
        )
    return lines[1:]


def _columns(row_type: type[Row]) -> list[str]:
    return [field.name for field in fields(row_type)]


def _texts(row: EvaluationRow | RankingRow | MetricRow, *before: str) -> list[str]:
    return [*before, *("" if value is None else str(value) for value in astuple(row))]


def _parsed(row_type: type[Row], line: Sequence[str]) -> Row | None:
    """None where the line is no such row."""
    readers = [_READERS[str(field.type)] for field in fields(row_type)]
    try:
        return row_type(*[read(text) for read, text in zip(readers, line, strict=True)])
    except ValueError:
        return None


def _truth(text: str) -> bool:
    if text not in ("True", "False"):
        raise ValueError(f"neither True nor False: {text}")
    return text == "True"


def _whole(text: str) -> int:
    if len(text) > 18:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)


_READERS: dict[str, Callable[[str], Any]] = {
    "int": _whole,
    "float": float,
    "str": str,
    "float | None": lambda text: float(text) if text else None,
    "bool | None": lambda text: _truth(text) if text else None,
}
"""How the text of a column is read, by the annotation of its field."""
