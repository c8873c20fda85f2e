"""The log of a run: one line a moment, and the same numbers in TensorBoard or Weights & Biases."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from importlib.machinery import ModuleSpec
from pathlib import Path

import numpy as np
import pytest
import wandb
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from bootifol import api, tracking
from bootifol.errors import BootifolError, BootifolWarning
from bootifol.presets import SMOKE
from bootifol.tracking import Averages, RunLog, TensorBoard, WeightsAndBiases, make_tracker
from bootifol.video_files.writing import write_video


def test_numbers_that_are_not_finite_are_null(tmp_path: Path) -> None:
    with RunLog(tmp_path) as tracker:
        tracker.log("cloning", "gradient_step", 3, 1.23456, {"a": math.nan, "b": -math.inf, "c": 0.5})
    text = (tmp_path / "metrics.jsonl").read_text()
    assert "NaN" not in text and "Infinity" not in text
    assert json.loads(text) == {
        "phase": "cloning",
        "gradient_step": 3,
        "seconds": 1.235,
        "a": None,
        "b": None,
        "c": 0.5,
    }


def test_a_resumed_run_goes_on_where_its_checkpoint_was(tmp_path: Path) -> None:
    with RunLog(tmp_path) as tracker:
        tracker.log("alignment", "gradient_step", 1, 0.0, {"loss/total": 2.0})
        at_checkpoint = tracker.bytes_written()
        tracker.log("alignment", "gradient_step", 2, 0.0, {"loss/total": 1.0})
    with tracker.path.open("r+b") as file:
        file.truncate(at_checkpoint)
    with RunLog(tmp_path) as resumed:
        assert resumed.bytes_written() == at_checkpoint
        resumed.log("alignment", "gradient_step", 2, 0.0, {"loss/total": 0.5})
        assert resumed.bytes_written() == tracker.path.stat().st_size
    lines = [json.loads(line) for line in tracker.path.read_text().splitlines()]
    assert [(line["gradient_step"], line["loss/total"]) for line in lines] == [(1, 2.0), (2, 0.5)]


def test_tensorboard_has_the_same_numbers(tmp_path: Path) -> None:
    with RunLog(tmp_path, TensorBoard(tmp_path)) as tracker:
        tracker.log("interactive", "agent_steps", 60, 1.0, {"episode/learned_reward": -0.25})
    events = EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    (scalar,) = events.Scalars("interactive/episode/learned_reward")
    assert (scalar.step, scalar.value) == (60, -0.25)


def test_averages_are_of_the_steps_since_the_last_ones() -> None:
    averages = Averages()
    for value in (1.0, 2.0, 6.0):
        averages.add({"loss/total": value})
    averages.add({"seldom": 5.0})
    assert averages.pop() == {"loss/total": 3.0, "seldom": 5.0}
    assert averages.pop() == {}
    averages.add({"agent/critic_loss": math.inf})
    with pytest.raises(BootifolError, match=r"agent/critic_loss was not a finite number"):
        averages.pop()


def synced(run: Path) -> list[tuple[str, bytes]]:
    """Of each session the id of its run of W&B, and what `wandb sync` would send, once W&B's own process has ended."""
    wandb.teardown()
    files = sorted(run.glob("wandb/offline-run-*/run-*.wandb"))
    return [(file.stem.removeprefix("run-"), file.read_bytes()) for file in files]


def test_wandb_gets_curves_videos_and_the_report_and_keeps_them_in_the_run(
    tmp_path: Path, offline: None
) -> None:
    run, page = tmp_path / "run", tmp_path / "run" / "report.html"
    write_video(run / "videos" / "agent-0.mp4", np.zeros((5, 32, 32, 3), np.uint8), 10)
    page.write_text("<html><body>what was learned</body></html>")
    with RunLog(run, WeightsAndBiases(run, {"task": "drawn_home"})) as log:
        log.log("interactive", "agent_steps", 60, 1.0, {"episode/learned_reward": 0.3125, "lost": math.nan})
        log.report(page, [run / "videos" / "agent-0.mp4"])
    ((_, sent),) = synced(run)
    for text in (
        b"drawn_home",
        b"interactive/episode/learned_reward",
        b"0.3125",
        b"showcase/agent-0",
        b"report",
    ):
        assert text in sent
    assert b"NaN" not in sent
    (shown,) = run.glob("wandb/offline-run-*/files/media/html/*.html")
    assert shown.read_text() == page.read_text()
    assert len(list(run.glob("wandb/offline-run-*/files/media/videos/showcase/agent-0*.mp4"))) == 1


def test_a_run_that_goes_on_has_the_same_id_at_wandb(tmp_path: Path, offline: None) -> None:
    for _ in range(2):
        WeightsAndBiases(tmp_path / "one", {}).close()
    WeightsAndBiases(tmp_path / "two", {}).close()
    kept = (tmp_path / "one" / "wandb" / "bootifol-id.txt").read_text().strip()
    assert {identity for identity, _ in synced(tmp_path / "one")} == {kept}
    assert kept != (tmp_path / "two" / "wandb" / "bootifol-id.txt").read_text().strip()


def test_learning_goes_on_where_wandb_does_not(
    tmp_path: Path, offline: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracker = WeightsAndBiases(tmp_path, {})

    def gone(_: object) -> None:
        raise ConnectionError("the service is gone")

    with RunLog(tmp_path, tracker) as log:
        real = tracker._run
        monkeypatch.setattr(tracker._run, "log", gone)
        with pytest.warns(BootifolWarning, match=r"hears no more of this run \(the service is gone\)"):
            log.log("interactive", "agent_steps", 60, 1.0, {"a": 1.0})
        log.log("interactive", "agent_steps", 120, 2.0, {"a": 2.0})
    real.finish()
    assert len((tmp_path / "metrics.jsonl").read_text().splitlines()) == 2


@pytest.mark.parametrize("found", [None, ModuleSpec("wandb", None)], ids=["nothing", "a directory of runs"])
def test_wandb_that_is_chosen_and_not_installed_is_a_sentence_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, found: ModuleSpec | None
) -> None:
    monkeypatch.setattr(tracking, "find_spec", lambda name: found)
    with pytest.raises(BootifolError, match=r"pip install 'bootifol\[wandb\]'"):
        api.train("drawn_home", tmp_path, tmp_path / "run", config=replace(SMOKE, tracker="wandb"))
    assert not (tmp_path / "run").exists()


def test_wandb_that_cannot_begin_leaves_nothing(
    tmp_path: Path, offline: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuses(**_: object) -> None:
        raise wandb.errors.UsageError("No API key configured.")

    monkeypatch.setattr(wandb, "init", refuses)
    with pytest.raises(BootifolError, match=r"cannot begin \(No API key configured\.\): log in"):
        make_tracker("wandb", tmp_path / "run", {})
    assert not list((tmp_path / "run").glob("*"))


def test_nobody_is_told_unless_it_is_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert make_tracker("none", tmp_path, {}) is None
    monkeypatch.setattr(tracking, "find_spec", lambda name: None)
    assert make_tracker("tensorboard", tmp_path, {}) is None, "it is not installed"
    assert not list(tmp_path.iterdir())
