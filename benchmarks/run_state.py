"""How far a run of a suite is, read from its directory: done, failed, begun, or not begun.

What tables and figures read of a run that is done is small: such a copy, kept elsewhere, says as well that it is done.
"""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from benchmarks.suites import RANDOM, PlannedRun
from bootifol.errors import BootifolError
from bootifol.files import read_json, written_aside
from bootifol.progress import duration
from bootifol.reports.comparison import decisive, unfinished_because
from bootifol.reports.run_files import read_run
from bootifol.training.config import TrainingConfig

State = Literal["not begun", "begun", "done", "failed"]

RESULT_FILES = ("config.json", "metrics.jsonl", "ranking.csv", "evaluations.csv")
"""What tables and curves are made of."""

_TAIL_BYTES = 64_000
"""Of metrics.jsonl: far more than its last lines."""


@dataclass(frozen=True)
class RunState:
    """How far a run is."""

    state: State
    gradient_steps: int = 0
    """Of alignment or cloning, by the newest line of metrics that counts them."""
    agent_steps: int = 0
    """By the newest line of metrics that counts them."""
    seconds: float = 0.0
    """Of learning, over all sessions."""
    error: str = ""
    """Of a failed run."""

    def __str__(self) -> str:
        far = f"{self.agent_steps:,} agent steps, {duration(self.seconds)}"
        if self.state == "not begun":
            return self.state
        if self.state == "failed":
            return f"failed after {far}: {self.error}"
        if self.state == "done":
            return f"done: {far}"
        return (
            far if self.agent_steps else f"{self.gradient_steps:,} gradient steps, {duration(self.seconds)}"
        )


def log_file(directory: Path) -> Path:
    """What a run printed, beside its directory."""
    return directory.with_name(f"{directory.name}.log")


def error_file(directory: Path) -> Path:
    """The sentence of a run that failed, beside its directory, until it is begun again."""
    return directory.with_name(f"{directory.name}.failed")


def run_state(directory: Path, copy: Path | None = None) -> RunState:
    """The state of the run in a directory.

    Its report is the last thing a run writes; but `bootifol report` writes one of a run in progress, too.

    Args:
        directory: of the run.
        copy: what `keep` has made of it, perhaps on another machine. If that is there, the run is done.
    """
    if copy is not None and _is_finished(copy):
        return RunState("done", *_progress(copy / "metrics.jsonl"))
    error = error_file(directory)
    state: State = "not begun"
    if (directory / "report.html").is_file() and _is_finished(directory):
        state = "done"
    elif error.is_file():
        state = "failed"
    elif (directory / "config.json").is_file():
        state = "begun"
    gradient_steps, agent_steps, seconds = _progress(directory / "metrics.jsonl")
    sentence = error.read_text().strip() if state == "failed" else ""
    return RunState(state, gradient_steps, agent_steps, seconds, sentence)


def keep(directory: Path, copy: Path) -> None:
    """Copies what tables and curves are made of, some hundred KB; no checkpoint, video or report."""
    copy.mkdir(parents=True, exist_ok=True)
    for name in RESULT_FILES:
        if (directory / name).is_file():
            with written_aside(copy / name) as aside:
                shutil.copyfile(directory / name, aside)


def _is_finished(directory: Path) -> bool:
    return (directory / "config.json").is_file() and unfinished_because(read_run(directory)) is None


def check_is_planned(run: PlannedRun, directory: Path, time_budget: float | None) -> None:
    """A run goes on as it was begun, so it must have been begun as the suite has it now.

    Args:
        run: of the suite.
        directory: where it was begun, if it was.
        time_budget: of the suite's runs, in seconds.

    Raises:
        BootifolError: another run is there.
    """
    if not (directory / "config.json").is_file():
        return
    there = read_json(directory / "config.json", "the run's configuration")
    wanted = {"task": run.task, "method": run.system.method, "preset": run.preset, "seed": run.seed}
    found = {name: there.get(name) for name in wanted}
    if run.system.method != RANDOM:  # which learns nothing, and has no budget
        # What JSON makes of it, as it was written there.
        planned, default = (
            decisive(json.loads(json.dumps(dataclasses.asdict(config))), run.system.method)
            for config in (run.config, TrainingConfig())
        )
        # A run that is older than a field was made as the field's default says.
        written = default | decisive(there.get("config", {}), run.system.method)
        wanted |= {"time_budget": time_budget, **planned}
        found |= {"time_budget": there.get("time_budget"), **written}
    for name, value in wanted.items():
        if found[name] != value:
            raise BootifolError(
                f"{directory} was begun with {name} {found[name]}, and this suite has {value}: choose another --out, "
                "or the options it was begun with; if the suite has changed since, remove it, and it is run again"
            )


def _progress(metrics: Path) -> tuple[int, int, float]:
    """Gradient steps, agent steps and seconds by the last whole lines of metrics.jsonl."""
    counts, seconds = {"gradient_step": 0, "agent_steps": 0}, 0.0
    if not metrics.is_file():
        return 0, 0, 0.0
    with metrics.open("rb") as file:
        file.seek(max(file.seek(0, os.SEEK_END) - _TAIL_BYTES, 0))
        lines = file.read().decode(errors="replace").splitlines()
    for line in lines:
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            continue  # cut where the tail begins, or half written
        if not isinstance(record, dict):
            continue
        for name in counts:
            counts[name] = int(record.get(name, counts[name]))
        seconds = float(record.get("seconds", seconds))
    return counts["gradient_step"], counts["agent_steps"], seconds
