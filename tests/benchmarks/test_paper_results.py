"""The file that the paper's tables are made of, from runs with numbers chosen by hand."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
from benchmarks.paper_results import COLUMNS, main, system_of, table
from benchmarks.rows import read_rows

from bootifol.reports.collection import add_to_collection
from bootifol.reports.run_files import read_run
from reports.made_up_runs import write_run

FRAMES = {"reward__bootifol__reward": "frames", "demonstrations__fraction": 0.0}


def table_of(directory: Path, runs: Iterable[Path]) -> list[tuple[str, ...]]:
    assert main([*map(str, runs), "--out", str(directory / "paper.csv")]) == 0
    return kept(directory / "paper.csv")


def kept(out: Path) -> list[tuple[str, ...]]:
    return [tuple(row[name] for name in COLUMNS[:8]) for row in read_rows(out, COLUMNS)]


def test_a_run_is_kept_under_its_task_system_and_seed(tmp_path: Path) -> None:
    runs, out = tmp_path / "runs", tmp_path / "paper.csv"
    write_run(runs / "frames", [40.0, 60.0], seed=2, seconds=120.0, **FRAMES)
    write_run(runs / "cloned", [80.0], demonstrations__fraction=0.25)
    experience = {**FRAMES, "demonstrations__fraction": 0.25, "demonstrations__cloning_updates": 0}
    write_run(runs / "experience", [90.0], **experience, agent__cloning_weight=0.0)
    write_run(
        runs / "clone", [70.0], **{**FRAMES, "demonstrations__fraction": 0.25}, agent__cloning_weight=1e6
    )
    assert main([str(runs), "--out", str(out)]) == 0
    assert kept(out) == [
        ("reacher_hard", "bootifol", "0", "0", "2", "2.0", "1000", "0.5000"),
        ("reacher_hard", "bootifol", "1", "0", "1", "1.0", "1000", "0.9000"),
        ("reacher_hard", "bootifol-sequences", "1", "1", "1", "1.0", "1000", "0.8000"),
        ("reacher_hard", "cloning", "1", "1", "1", "1.0", "1000", "0.7000"),
    ]


def test_a_collection_gives_the_rows_of_its_runs(tmp_path: Path) -> None:
    runs = {
        f"seed{seed}": write_run(tmp_path / f"{seed}", [10.0 * seed], seed=seed, **FRAMES) for seed in (1, 2)
    }
    add_to_collection(tmp_path / "kept", runs)
    found = [table_of(tmp_path, paths) for paths in (runs.values(), [tmp_path / "kept"])]
    assert found[0] == found[1] and len(found[0]) == 2


def test_two_runs_of_one_name_are_refused_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a", "b"):
        write_run(tmp_path / "runs" / name, **FRAMES)
    assert main([str(tmp_path / "runs"), "--out", str(tmp_path / "paper.csv")]) == 2
    assert "reacher_hard bootifol 0 0 1" in capsys.readouterr().err
    assert not (tmp_path / "paper.csv").exists()


def test_a_run_without_its_last_evaluation_is_called_unfinished(tmp_path: Path) -> None:
    out = tmp_path / "paper.csv"
    write_run(tmp_path / "runs" / "one", [40.0] * 50, seed=1, **FRAMES)
    write_run(tmp_path / "runs" / "two", [90.0] * 5, seed=2, **FRAMES)
    assert main([str(tmp_path / "runs"), "--out", str(out)]) == 0
    cells = table(read_rows(out, COLUMNS)).splitlines()[-1].split(" | ")
    assert cells[2:5] == ["0.40", "0.40", "0.90 at 1,000"], "no mean over what is not finished"


def test_the_figure_is_a_png(tmp_path: Path) -> None:
    out, figure = tmp_path / "paper.csv", tmp_path / "returns.png"
    write_run(tmp_path / "runs" / "one", **FRAMES)
    assert main([str(tmp_path / "runs"), "--out", str(out), "--figure", str(figure)]) == 0
    assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("method", ["gaifo", "environment"])
def test_other_systems_have_their_methods_name(tmp_path: Path, method: str) -> None:
    assert system_of(read_run(write_run(tmp_path / "run", method=method))) == method
