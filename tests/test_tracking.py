"""The log of a run: one line a moment, and the same numbers in TensorBoard."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from bootifol.errors import BootifolError
from bootifol.tracking import Averages, Tracker


def test_numbers_that_are_not_finite_are_null(tmp_path: Path) -> None:
    with Tracker(tmp_path, tensorboard=False) as tracker:
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
    with Tracker(tmp_path, tensorboard=False) as tracker:
        tracker.log("alignment", "gradient_step", 1, 0.0, {"loss/total": 2.0})
        at_checkpoint = tracker.bytes_written()
        tracker.log("alignment", "gradient_step", 2, 0.0, {"loss/total": 1.0})
    with tracker.path.open("r+b") as file:
        file.truncate(at_checkpoint)
    with Tracker(tmp_path, tensorboard=False) as resumed:
        assert resumed.bytes_written() == at_checkpoint
        resumed.log("alignment", "gradient_step", 2, 0.0, {"loss/total": 0.5})
        assert resumed.bytes_written() == tracker.path.stat().st_size
    lines = [json.loads(line) for line in tracker.path.read_text().splitlines()]
    assert [(line["gradient_step"], line["loss/total"]) for line in lines] == [(1, 2.0), (2, 0.5)]


def test_tensorboard_has_the_same_numbers(tmp_path: Path) -> None:
    with Tracker(tmp_path) as tracker:
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
