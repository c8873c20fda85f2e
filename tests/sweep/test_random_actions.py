"""Random actions, written down like a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from bootifol.reports.run_files import read_run
from bootifol.sweep.planned import RANDOM, PlannedRun
from bootifol.sweep.random_actions import main
from bootifol.sweep.run_state import run_state


def test_random_actions_leave_what_tables_read(tmp_path: Path) -> None:
    sizes = (("pictures.agent_size", 32), ("pictures.video_size", 32))
    run = PlannedRun("drawn_home", RANDOM, "smoke", overrides=sizes, seed=3, time_budget="60m")
    for words in (run.words(tmp_path / "run"), run.words_to_resume(tmp_path / "run")):
        assert words[0] == RANDOM
        assert main(words[1:]) == 0
    assert run_state(tmp_path / "run").state == "done"
    written = read_run(tmp_path / "run")
    assert (written.task, written.method, written.seed) == ("drawn_home", "random", 3)
    assert len(written.evaluations) == 2
    assert all(row.scaled_return is not None and row.scaled_return < 0.5 for row in written.evaluations)


def test_bad_input_gets_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--task", "reacher_harder", "--demos", "demos", "--out", str(tmp_path / "run")]
    assert main(words) == 2
    assert "error: there is no task 'reacher_harder'" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
