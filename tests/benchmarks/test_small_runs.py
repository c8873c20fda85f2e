"""Benchmarks at their smallest, through their own main: that they still run, and say what is wrong."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from benchmarks import gallery
from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.evaluation.ranking import KINDS
from bootifol.tasks import TASKS

RunBenchmark = Callable[..., int | None]
"""Name and words of a command to its exit code."""


@pytest.fixture
def run_benchmark(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> RunBenchmark:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "160")

    def run(name: str, *words: str) -> int | None:
        monkeypatch.setattr(sys, "argv", [name, *words])
        return importlib.import_module(f"benchmarks.{name}").main()

    return run


def test_alignment_ranking(
    run_benchmark: RunBenchmark, demos: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pictures = PictureConfig(agent_size=32, video_size=32)
    for behavior in KINDS:
        if behavior == "half_good":
            record("drawn_home", behavior, 4, Path("demos") / behavior, pictures)
        else:
            Path("demos").mkdir(exist_ok=True)
            (Path("demos") / behavior).symlink_to(demos / behavior)
    words = [
        "--task",
        "drawn_home",
        "--preset",
        "smoke",
        "--demos",
        "demos",
        "--held-out",
        "1",
        "--out",
        "tau.csv",
    ]
    assert run_benchmark("alignment_ranking", *words, "--steps", "4", "--every", "2", "--only", "preset") == 0
    header, *rows = Path("tau.csv").read_text().splitlines()
    assert header.startswith("variant,gradient_step,sequence_loss,kendall_tau")
    assert [row.split(",")[:2] for row in rows] == [["preset", "2"], ["preset", "4"]]
    assert run_benchmark("alignment_ranking", *words, "--only", "presets") == 2
    assert "there is no variant 'presets'" in capsys.readouterr().err


def test_backbone(
    run_benchmark: RunBenchmark, tiny_backbone: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_benchmark("backbone", tiny_backbone, "--size", "32", "--frames", "2", "--runs", "1") == 0
    said = capsys.readouterr().out
    assert "tiny-efficientnet" in said and " 32 " in said


def test_gallery(run_benchmark: RunBenchmark, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gallery, "TASKS", {"drawn_reach": TASKS["drawn_reach"]})
    assert run_benchmark("gallery", "--out", "gallery.png") == 0
    with Image.open("gallery.png") as picture:
        assert picture.width == 1248
        assert len(picture.convert("RGB").getcolors(1 << 20) or []) > 5


def test_fuzz_import_reads_every_file_that_nobody_damaged(
    run_benchmark: RunBenchmark, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_benchmark("fuzz_import", "--minutes", "0") == 0
    assert "no crash, no hang, no short read" in capsys.readouterr().out


def test_diagnosis_of_no_run_is_a_sentence(
    run_benchmark: RunBenchmark, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_benchmark("diagnosis", "nowhere", "--out", "figure") == 2
    assert capsys.readouterr().err.startswith("error: nowhere is not a run")


@pytest.mark.parametrize("name", ["any_environment", "diagnosis", "meta_world_rendering"])
def test_help(run_benchmark: RunBenchmark, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run_benchmark(name, "--help")
    assert ended.value.code == 0
    assert f"usage: {name}" in capsys.readouterr().out
