"""The table of costs: what is counted, and that it is gone on with. Times are not asserted."""

from __future__ import annotations

import json
import subprocess
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from benchmarks import cost
from bootifol.errors import BootifolError

SUITES = Path(__file__).parents[2] / "benchmarks" / "suites"
ROW = dict.fromkeys(cost.COLUMNS, "1")


def test_a_row_counts_parameters_and_memory(demos: Path) -> None:
    (run,) = cost.systems(SUITES / "smoke.yaml", "drawn_home", 1, ["environment"])
    row = cost.measured(replace(run, demos=demos), steps=1)
    assert list(row) == list(cost.COLUMNS)
    assert row["reward_parameters"] == "0" and int(row["agent_parameters"]) > 0
    assert float(row["seconds_learning"]) > 0 and int(row["peak_memory_mb"]) > 0
    # 3000 frames of replay at 32 pixels, actions and reward; 50 videos of 31 frames; no demonstrations
    assert int(row["stores_mb"]) == round((3000 * (3 * 32**2 + 12) + 50 * 31 * 3 * 32**2) / 1e6)


def test_parameters_are_counted_by_hand() -> None:
    assert cost.parameters([torch.nn.Linear(3, 2), None, torch.nn.LayerNorm(4)]) == 3 * 2 + 2 + 4 + 4


def test_only_what_is_missing_is_measured(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured: list[str] = []

    def run(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        measured.append(command[-1])
        threads = command[command.index("--threads") + 1]
        row = ROW | {"task": "drawn_home", "preset": "smoke", "system": command[-1], "threads": threads}
        code = 2 if measured.count("virl") == 1 and command[-1] == "virl" else 0
        return subprocess.CompletedProcess(command, code, stdout=f"a line\n{json.dumps(row)}\n")

    monkeypatch.setattr(subprocess, "run", run)
    sweep = tmp_path / "mine.yaml"
    sweep.write_text(
        f"tasks: drawn_home\nmethods: [gaifo, virl, random, environment]\npresets: smoke\ndemos: {demos}\n"
    )
    arguments = Namespace(
        sweep=sweep, task="drawn_home", systems=None, steps=1, threads=1, out=tmp_path / "cost.csv"
    )
    with pytest.raises(BootifolError, match="virl could not be measured"):
        cost.compare(arguments)
    cost.compare(arguments)
    assert measured == ["gaifo", "virl", "virl", "environment"]
    cost.compare(Namespace(**vars(arguments) | {"systems": ["gaifo"], "threads": 2}))
    assert measured[4:] == ["gaifo"], "two threads are another measurement"
    table = (tmp_path / "cost.md").read_text().splitlines()
    assert table[0].startswith("| task | preset | system | threads |") and len(table) == 2 + 4


def test_an_unknown_system_or_task_is_named() -> None:
    with pytest.raises(BootifolError, match="no system 'magic' on reacher_hard; the systems are bootifol,"):
        cost.systems(SUITES / "cpu.yaml", "reacher_hard", 1, ["magic"])
    with pytest.raises(BootifolError, match="has no run on drawn_reach that learns"):
        cost.systems(SUITES / "cpu.yaml", "drawn_reach", 1)


def test_the_backbone_is_measured_where_the_paper_has_it() -> None:
    measured = {
        task: {run.system for run in cost.systems(SUITES / "cpu.yaml", task, 1)}
        for task in ("reacher_hard", "drawer_close")
    }
    assert measured["drawer_close"] - measured["reacher_hard"] == {"bootifol-backbone"}
    assert "random" not in measured["reacher_hard"]


def test_videos_of_another_size_are_recorded_apart(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded: list[list[str]] = []

    def record_nothing(command: list[str]) -> subprocess.CompletedProcess[str]:
        recorded.append(command)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", record_nothing)
    small, large = cost.systems(SUITES / "backbone.yaml", "drawer_close", 1)
    assert cost.videos_of(replace(small, demos=demos), tmp_path) == demos
    assert not recorded
    large = replace(large, demos=tmp_path / "none" / "drawer_close-224")
    assert cost.videos_of(large, tmp_path / "spare") == tmp_path / "spare" / "drawer_close-224"
    assert recorded[0][recorded[0].index("--video-size") + 1] == "224"
