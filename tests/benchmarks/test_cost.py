"""The table of costs: what is counted, and that it is gone on with. Times are not asserted."""

from __future__ import annotations

import json
import subprocess
from argparse import Namespace
from pathlib import Path

import pytest
import torch
from benchmarks.suites import SMALL, PlannedRun, System, backbone_comparison

from benchmarks import cost
from bootifol.errors import BootifolError
from bootifol.presets import CPU

ROW = dict.fromkeys(cost.COLUMNS, "1")


def test_a_row_counts_parameters_and_memory(demos: Path) -> None:
    arguments = Namespace(task="drawn_home", preset="smoke", threads=1, steps=1, demos=demos)
    row = cost.measured(arguments, System("environment", overrides=SMALL))
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
    (tmp_path / "demos").mkdir()
    (tmp_path / "demos" / "drawn_home").symlink_to(demos)
    arguments = Namespace(
        task="drawn_home",
        preset="smoke",
        systems=["gaifo", "virl", "environment"],
        demos=tmp_path / "demos",
        steps=1,
        threads=1,
        out=tmp_path / "cost.csv",
    )
    with pytest.raises(BootifolError, match="virl could not be measured"):
        cost.compare(arguments)
    cost.compare(arguments)
    assert measured == ["gaifo", "virl", "virl", "environment"]
    cost.compare(Namespace(**vars(arguments) | {"systems": ["gaifo"], "threads": 2}))
    assert measured[4:] == ["gaifo"], "two threads are another measurement"
    table = (tmp_path / "cost.md").read_text().splitlines()
    assert table[0].startswith("| task | preset | system | threads |") and len(table) == 2 + 4


def test_an_unknown_system_is_named() -> None:
    assert "random" not in [system.name for system in cost.systems("cpu", None, "reacher_hard")]
    with pytest.raises(BootifolError, match="there is no system 'magic'; the systems are bootifol,"):
        cost.systems("cpu", ["magic"], "reacher_hard")


def test_the_backbone_is_measured_where_the_paper_has_it_or_when_asked_for() -> None:
    measured = {
        task: [system.name for system in cost.systems("cpu", None, task)]
        for task in ("reacher_hard", "drawer_close")
    }
    assert [*measured["reacher_hard"][:2], "bootifol-backbone"] == measured["drawer_close"][:3]
    assert [system.name for system in cost.systems("cpu", ["bootifol-backbone"], "reacher_hard")] == [
        "bootifol-backbone"
    ]


def test_videos_of_another_size_are_recorded_apart(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "drawn_home").symlink_to(demos)
    recorded: list[list[str]] = []

    def record_nothing(command: list[str]) -> subprocess.CompletedProcess[str]:
        recorded.append(command)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(subprocess, "run", record_nothing)
    small, large = (PlannedRun("drawn_home", "cpu", system, 1) for system in backbone_comparison(CPU, False))
    assert cost.videos_of(small, tmp_path, tmp_path / "spare") == tmp_path / "drawn_home"
    assert not recorded
    assert cost.videos_of(large, tmp_path, tmp_path / "spare") == tmp_path / "spare" / "drawn_home-224"
    assert recorded[0][recorded[0].index("--video-size") + 1] == "224"
