"""`benchmarks/learning_test.py`, made tiny: its rows, that it goes on where it stopped, its table and its picture."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.rows import Row, read_rows

from benchmarks import learning_test
from bootifol.demos.record import record_demos
from bootifol.envs.pictures import PictureConfig
from bootifol.presets import DRAWN
from bootifol.rewards.registry import METHODS, check_method
from bootifol.tasks import task_named

TASK = task_named("drawn_home")


def row(method: str, seed: int, agent_steps: int, environment_return: float) -> Row:
    return learning_test.row_of(TASK, method, seed, agent_steps, 60.0, [environment_return])


def test_every_method_takes_part() -> None:
    systems = learning_test.systems(DRAWN, "drawn_home")
    assert {system.method for system in systems.values()} >= {*METHODS, "random"}
    assert len(set(systems.values())) == len(systems) == 9


def test_the_table_judges_the_last_evaluation_of_each_seed() -> None:
    rows = [
        row("virl", 1, 0, 50.0),
        row("virl", 1, 900, 10.0),
        row("virl", 2, 900, 40.0),
        row("gaifo", 1, 900, 3.2),
    ]
    virl, gaifo = learning_test.table(rows, TASK).splitlines()[2:]
    # Scaled: (10 - 3.2) / 49.2 and (40 - 3.2) / 49.2; above 0.6 of the expert's 52.4 is the second alone.
    assert virl == "| virl | 2 | 900 | 1.0 | 25.0 | 0.44 | 0.14 … 0.75 | 1 of 2 |"
    assert gaifo == "| gaifo | 1 | 900 | 1.0 | 3.2 | 0.00 | – | 0 of 1 |"


def test_it_trains_evaluates_and_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    few = replace(DRAWN, evaluation=replace(DRAWN.evaluation, final_episodes=8))
    monkeypatch.setattr(learning_test, "preset", lambda name: few)
    record_demos("drawn_home", tmp_path / "demos", episodes=12, pictures=PictureConfig(32, 32))
    words = [
        "--demos",
        str(tmp_path / "demos"),
        "--runs",
        str(tmp_path / "runs"),
        "--out",
        str(tmp_path / "m.csv"),
    ]
    tiny = [*words, "--agent-steps", "60", "--seeds", "1", "--methods", "virl", "random"]
    learning_test.main(tiny)
    rows = read_rows(tmp_path / "m.csv", learning_test.COLUMNS)
    assert [(each["method"], each["agent_steps"], each["episodes"]) for each in rows] == [
        ("virl", "60", "8"),
        ("random", "0", "8"),
    ]
    assert abs(float(rows[1]["scaled_return"])) < 0.3
    assert (tmp_path / "m.png").stat().st_size > 1000
    assert (tmp_path / "m.md").read_text().count("\n") == 4
    check_method("optimal_transport:OptimalTransport")  # the page's file lies where a run will look for it

    monkeypatch.delattr(learning_test, "Run")  # what is done is not done again
    learning_test.main(tiny)
    assert read_rows(tmp_path / "m.csv", learning_test.COLUMNS) == rows
    capsys.readouterr()
    assert learning_test.main([*words, "--agent-steps", "90", "--seeds", "1", "--methods", "virl"]) == 2
    assert "virl-seed1 holds another run: choose" in capsys.readouterr().err
    assert learning_test.main([*words, "--methods", "gail"]) == 2
    assert "no system 'gail' on drawn_home: choose of bootifol, bootifol-cosine" in capsys.readouterr().err
