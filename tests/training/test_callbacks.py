"""Callbacks: when they are called, that they stop a run where it can be resumed, and that they change nothing."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tiny_runs import ENDS_SOON

import bootifol
from bootifol.errors import BootifolError
from bootifol.files import read_arrays
from bootifol.training.checkpoint import newest_checkpoint

ROOT = Path(__file__).parents[2]

QUICK = replace(
    ENDS_SOON,
    evaluation_steps=30,
    evaluation=replace(ENDS_SOON.evaluation, long_episodes=1, final_episodes=1, showcase_episodes=1),
)
"""The run of the fixture `finished` with less to measure, which changes nothing that it learns."""


class Notes(bootifol.Callback):
    """Writes down what it is told, and spoils what it is given."""

    def __init__(self) -> None:
        self.events: list[tuple[Any, ...]] = []

    def on_start(self, directory: Path) -> None:
        self.events.append(("start", directory))

    def on_log(self, phase: str, count: int, metrics: Mapping[str, float]) -> None:
        self.events.append(("log", phase, count, dict(metrics)))
        metrics.clear()  # type: ignore[attr-defined]

    def on_evaluation(self, agent_steps: int, returns: Mapping[str, float]) -> None:
        self.events.append(("evaluation", agent_steps, dict(returns)))
        returns.clear()  # type: ignore[attr-defined]

    def on_checkpoint(self, path: Path) -> None:
        assert (path / "checkpoint.json").is_file()
        self.events.append(("checkpoint", path.name))

    def on_end(self, finished: bool) -> None:
        self.events.append(("end", finished))

    def of(self, kind: str) -> list[tuple[Any, ...]]:
        return [event for event in self.events if event[0] == kind]


class RaisesAt(bootifol.Callback):
    """Raises at the given number of agent steps."""

    def __init__(self, error: Exception, agent_steps: int = 0) -> None:
        self.error, self.agent_steps = error, agent_steps

    def on_log(self, phase: str, count: int, metrics: Mapping[str, float]) -> None:
        if phase == "interactive" and count >= self.agent_steps:
            raise self.error


def train(directory: Path, demos: Path, *callbacks: bootifol.Callback) -> bool:
    return bootifol.train(
        "drawn_reach", demos, directory, preset="smoke", config=QUICK, callbacks=callbacks
    ).finished


def test_they_are_told_everything_and_change_nothing(tmp_path: Path, demos: Path, finished: Path) -> None:
    one, other, run = Notes(), Notes(), tmp_path / "run"
    assert train(run, demos, one, other)
    assert one.events == other.events
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    told = [(line["phase"], line.get("gradient_step", line.get("agent_steps"))) for line in lines]
    assert [(phase, count) for _, phase, count, _ in one.of("log")] == told
    assert all(
        metrics.keys() <= line.keys() for (*_, metrics), line in zip(one.of("log"), lines, strict=True)
    )
    assert one.of("evaluation")[-1][1] == ENDS_SOON.interactive.agent_steps
    assert "evaluation/return_30" in one.of("evaluation")[-1][2]
    assert one.events[0] == ("start", run) and one.events[-1] == ("end", True)
    assert one.of("checkpoint")[-1] == ("checkpoint", newest_checkpoint(run / "checkpoints").name)  # type: ignore[union-attr]
    ours, theirs = (read_arrays(each / "policy.safetensors", "") for each in (run, finished))
    assert all((ours[name] == theirs[name]).all() for name in theirs)


def test_one_that_stops_leaves_a_checkpoint_and_the_run_goes_on_from_there(
    tmp_path: Path, demos: Path, finished: Path
) -> None:
    notes, run = Notes(), tmp_path / "run"
    assert not train(run, demos, RaisesAt(bootifol.StopTraining("enough")), notes)
    assert notes.events[-2][0] == "checkpoint" and notes.events[-1] == ("end", False)
    assert not (run / "report.html").exists()
    again = Notes()
    assert bootifol.resume(run, callbacks=[again])
    assert again.events[0] == ("start", run) and again.events[-1] == ("end", True)
    ours, theirs = (read_arrays(each / "policy.safetensors", "") for each in (run, finished))
    assert all((ours[name] == theirs[name]).all() for name in theirs)


def test_stopping_a_run_that_has_ended_does_nothing(tmp_path: Path, demos: Path) -> None:
    """Else it would stop before its report each time that it is resumed."""
    last = ENDS_SOON.interactive.agent_steps

    class StopsAtTheEnd(bootifol.Callback):
        def on_evaluation(self, agent_steps: int, returns: Mapping[str, float]) -> None:
            if agent_steps == last:
                raise bootifol.StopTraining

        def on_end(self, finished: bool) -> None:
            raise bootifol.StopTraining

    assert train(tmp_path / "run", demos, StopsAtTheEnd())
    assert (tmp_path / "run" / "report.html").is_file()


def test_an_error_of_theirs_comes_out_and_the_run_can_be_resumed(tmp_path: Path, demos: Path) -> None:
    notes, run = Notes(), tmp_path / "run"
    with pytest.raises(ZeroDivisionError, match="mine"):
        train(run, demos, RaisesAt(ZeroDivisionError("mine")), notes)
    assert notes.events[-1] == ("end", False)
    assert bootifol.resume(run)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [(print, r"callbacks\[0\] is <built-in"), (Notes, r"callbacks\[0\] is the class Notes")],
)
def test_what_is_no_callback_is_refused(tmp_path: Path, demos: Path, given: Any, sentence: str) -> None:
    with pytest.raises(BootifolError, match=sentence):
        train(tmp_path / "run", demos, given)
    assert not (tmp_path / "run").exists()


@pytest.fixture
def example() -> Any:
    spec = importlib.util.spec_from_file_location("stop_early", ROOT / "examples" / "stop_early.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_example_stops_where_the_reward_no_longer_rises(example: Any) -> None:
    stops = example.StopEarly(patience=2)
    for reward in (0.1, 0.3, 0.2):
        stops.on_log("interactive", 60, {"episode/learned_reward": reward})
        stops.on_log("interactive", 60, {"evaluation/return_60": 1.0})
    with pytest.raises(bootifol.StopTraining, match=r"after 120 agent steps, the best reward was 0\.30"):
        stops.on_log("interactive", 120, {"episode/learned_reward": 0.3})


def test_the_example_runs(
    tmp_path: Path, demos: Path, example: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    run = str(tmp_path / "run")
    overrides = {"interactive.log_every": 30, "evaluation.every": 30, "interactive.agent_steps": 3000}
    assert not example.learn("drawn_reach", str(demos), run, patience=1, config=QUICK, overrides=overrides)
    printed = capsys.readouterr().out
    assert "agent steps: return_30 " in printed and "report.html" in printed
