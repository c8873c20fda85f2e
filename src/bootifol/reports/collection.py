"""Many runs in few files: of each what tables and figures read, together in one directory.

A collection is a directory that holds `runs.json`: by the name of a run, what its `config.json` held and how far it
came. Beside it lies `evaluations.csv` and, where they were kept, `ranking.csv` and `metrics.csv`, with the name of the
run in a first column. A run of a collection has the path COLLECTION/NAME, as if its directory lay there.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from bootifol.errors import BootifolError, shortened
from bootifol.evaluation.tables import EvaluationRow, MetricRow, RankingRow, Row, read_by_run, write_by_run
from bootifol.files import read_json, written_aside
from bootifol.reports.run_files import (
    COUNTERS,
    Curve,
    RunFiles,
    described,
    find_runs,
    is_run,
    read_run,
    read_table,
)

RUNS, EVALUATIONS, RANKING, METRICS = "runs.json", "evaluations.csv", "ranking.csv", "metrics.csv"

KEPT = "This run is one of a collection, which keeps no films and not all metrics."


def read_runs(paths: Sequence[Path]) -> list[RunFiles]:
    """The runs at the paths and below them, each once, in the order given: of run directories and of collections.

    Args:
        paths: directories of runs or collections, or that hold some; or COLLECTION/NAME, where NAME may be the
            beginning of several, as that of a directory would be.

    Raises:
        BootifolError: there are no paths, one leads to no run, or a run or a collection cannot be read.
    """
    collections: dict[Path, list[RunFiles]] = {}
    found: dict[Path, RunFiles] = {}
    for place in find_runs(paths, _is_readable):
        if is_run(place):
            runs = [read_run(place)]
        else:
            collection = place if is_collection(place) else _collection_around(place)
            assert collection is not None
            if collection not in collections:
                collections[collection] = read_collection(collection)
            runs = [run for run in collections[collection] if run.path.is_relative_to(place)]
            if not runs:
                names = dict.fromkeys(
                    run.path.relative_to(collection).parts[0] for run in collections[collection]
                )
                raise BootifolError(
                    f"there is no run {place.relative_to(collection)} in the collection {collection}; "
                    f"it has {', '.join(names) or 'none'}"
                )
        for run in runs:
            found.setdefault(run.path.resolve(), run)
    return list(found.values())


def is_collection(path: Path) -> bool:
    """Whether a directory is a collection."""
    return (path / RUNS).is_file()


def read_collection(path: Path) -> list[RunFiles]:
    """All runs of a collection.

    What its tables lack or cannot tell is said in the notes of each run.

    Raises:
        BootifolError: its list of runs is missing or damaged.
    """
    notes = [KEPT]
    evaluations = _by_run(
        read_table(path / EVALUATIONS, lambda file: read_by_run(file, EvaluationRow), "evaluations", notes)
    )
    ranking = _by_run(
        read_table(path / RANKING, lambda file: read_by_run(file, RankingRow), "ranking of videos", notes)
    )
    metrics = _by_run(
        read_table(path / METRICS, lambda file: read_by_run(file, MetricRow), "metrics over time", notes)
    )
    return [
        described(
            path / name,
            kept["config.json"],
            path / RUNS,
            list(notes),
            curves=_curves(metrics.get(name, [])),
            phase_seconds={phase: (first, last) for phase, (first, last) in kept["phase_seconds"].items()},
            evaluations=evaluations.get(name, []),
            ranking=ranking.get(name, []),
            agent_steps=kept["agent_steps"],
        )
        for name, kept in _read_list(path).items()
    ]


def add_to_collection(
    path: Path, run_dirs: Mapping[str, Path], metrics: Collection[str] = (), ranking: bool = False
) -> None:
    """Adds runs to a collection, or makes one. A run replaces the one of the same name, all others stay.

    Every file is written whole, the list of runs last: after an interruption the same call mends what differs.

    Args:
        path: the collection's.
        run_dirs: directories of runs by the names that they get.
        metrics: names of the metrics to keep.
        ranking: whether the rankings of held-out videos are kept.

    Raises:
        BootifolError: a run has no evaluation, no run has logged one of the metrics, the collection is damaged, or
            its directory is a run's.
    """
    if is_run(path):
        raise BootifolError(f"{path} is the directory of a run: choose another one for the collection")
    kept = _read_list(path) if is_collection(path) else {}
    evaluations = _to_change(path / EVALUATIONS, EvaluationRow)
    rankings = _to_change(path / RANKING, RankingRow)
    logged = _to_change(path / METRICS, MetricRow)
    seen: set[str] = set()
    for name, run_dir in run_dirs.items():
        if not _is_name(name):
            raise BootifolError(
                f"{shortened(name)} is no name for a run in a collection: rename the directory"
            )
        run = read_run(run_dir)
        if not run.evaluations:
            told = " ".join(note for note in run.notes if note.startswith(EVALUATIONS))
            raise BootifolError(
                f"{run_dir} has no evaluation to keep; let it learn until its first one. {told}"
            )
        kept[name] = {
            "config.json": read_json(
                run_dir / "config.json", f"the configuration of {run_dir}", editable=True
            ),
            "agent_steps": run.agent_steps,
            "phase_seconds": dict(run.phase_seconds),
        }
        evaluations[name] = list(run.evaluations)
        rankings[name] = list(run.ranking) if ranking else []
        logged[name] = [
            MetricRow(phase, int(step), metric, float(value))
            for (phase, metric), curve in run.curves.items()
            if metric in metrics
            for step, value in zip(curve.steps, curve.values, strict=True)
        ]
        seen |= {metric for _, metric in run.curves}
    if missing := [metric for metric in metrics if metric not in seen]:
        raise BootifolError(
            f"no run has logged {', '.join(missing)}; choose of {', '.join(sorted(seen)) or 'none'}"
        )
    names = sorted(kept, key=lambda name: PurePosixPath(name).parts)
    _write(path / EVALUATIONS, EvaluationRow, evaluations, names)
    _write(path / RANKING, RankingRow, rankings, names)
    _write(path / METRICS, MetricRow, logged, names)
    lines = [f"{json.dumps(name)}: {json.dumps(kept[name], allow_nan=False)}" for name in names]
    with written_aside(path / RUNS) as aside:
        aside.write_text("{\n" + ",\n".join(lines) + "\n}\n")


def _is_readable(path: Path) -> bool:
    return is_run(path) or is_collection(path) or _collection_around(path) is not None


def _collection_around(path: Path) -> Path | None:
    """The collection that a path leads into, where nothing lies on the disk."""
    return None if path.exists() else next((each for each in path.parents if is_collection(each)), None)


def _read_list(path: Path) -> dict[str, Any]:
    """The content of `runs.json`, checked as far as it is relied on."""
    kept = read_json(path / RUNS, f"the list of the runs of the collection {path}", editable=True)
    if not isinstance(kept, dict):
        raise BootifolError(f"{path / RUNS} is damaged: it is no list of runs; {_MEND}")
    for name, run in kept.items():
        if not _is_name(name):
            raise BootifolError(f"{path / RUNS} is damaged: {shortened(name)} is no name of a run; {_MEND}")
        if not isinstance(run, dict) or not _is_record(run):
            raise BootifolError(f"{path / RUNS} is damaged: it does not tell how far {name} came; {_MEND}")
    return kept


_MEND = "bring it back from where it was copied, or remove it and collect the runs again"


def _is_name(name: str) -> bool:
    """Whether a run of this name lies in the collection and can be told by a path."""
    place = PurePosixPath(name)
    return name.isprintable() and bool(place.parts) and not place.is_absolute() and ".." not in place.parts


def _is_record(run: dict[str, Any]) -> bool:
    steps, phases = run.get("agent_steps"), run.get("phase_seconds")
    return (
        "config.json" in run
        and isinstance(steps, int)
        and isinstance(phases, dict)
        and all(phase in COUNTERS and _is_span(span) for phase, span in phases.items())
    )


def _is_span(value: object) -> bool:
    """Whether a value is two numbers, the first and the last seconds of a phase."""
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(each, int | float) and math.isfinite(each) for each in value)
    )


def _by_run(rows: Sequence[tuple[str, Row]]) -> dict[str, list[Row]]:
    grouped: dict[str, list[Row]] = {}
    for name, row in rows:
        grouped.setdefault(name, []).append(row)
    return grouped


def _curves(rows: Sequence[MetricRow]) -> dict[tuple[str, str], Curve]:
    points: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for row in rows:
        if math.isfinite(row.value):
            points.setdefault((row.phase, row.name), []).append((row.step, row.value))
    return {key: Curve(*np.array(sorted(each, key=lambda point: point[0])).T) for key, each in points.items()}


def _to_change(path: Path, row_type: type[Row]) -> dict[str, list[Row]]:
    """The rows of a table that is about to be written again; none where there is none."""
    if not path.exists():
        return {}
    table = read_by_run(path, row_type)
    if table.damaged_lines:
        raise BootifolError(f"{path} is damaged in line {table.damaged_lines[0]}; {_MEND}")
    return _by_run(table.rows)


def _write(path: Path, row_type: type[Row], rows: Mapping[str, list[Row]], names: Sequence[str]) -> None:
    """Writes a table; where it would be empty there is none."""
    if any(rows.values()):
        write_by_run(path, row_type, [(name, row) for name in names for row in rows.get(name, [])])
    else:
        path.unlink(missing_ok=True)
