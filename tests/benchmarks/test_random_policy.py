"""Random actions, written down like a run."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from benchmarks.random_policy import main
from benchmarks.run_state import run_state
from benchmarks.suites import RANDOM, SMALL, PlannedRun, System

from bootifol.reports.run_files import read_run


def test_a_random_policy_leaves_what_tables_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    planned = PlannedRun("drawn_home", "smoke", System(RANDOM, overrides=SMALL), 3)
    words = planned.words(tmp_path / "demos", tmp_path / "run", time_budget="60m")
    monkeypatch.setattr(sys, "argv", ["random_policy", *words])
    for _ in range(2):  # begun again after an interruption
        main()
    assert run_state(tmp_path / "run").state == "done"
    run = read_run(tmp_path / "run")
    assert (run.task, run.method, run.seed) == ("drawn_home", "random", 3)
    assert len(run.evaluations) == 2
    assert all(row.scaled_return is not None and row.scaled_return < 0.5 for row in run.evaluations)


def test_bad_input_gets_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--task", "reacher_harder", "--demos", "demos", "--out", str(tmp_path / "run")]
    monkeypatch.setattr(sys, "argv", ["random_policy", *words])
    assert main() == 2
    assert "error: there is no task 'reacher_harder'" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
