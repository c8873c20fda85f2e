"""How far a run of a sweep is, read from its directory: done, failed, begun, or not begun."""

from __future__ import annotations

import dataclasses
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bootifol.errors import BootifolError
from bootifol.files import read_json
from bootifol.old_names import with_todays_names
from bootifol.progress import duration
from bootifol.reports.comparison import decisive, unfinished_because
from bootifol.reports.run_files import read_run
from bootifol.sweep.beside import error_file
from bootifol.sweep.planned import RANDOM, PlannedRun
from bootifol.training.config import TrainingConfig

State = Literal["not begun", "begun", "done", "failed"]

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

    @property
    def far(self) -> str:
        """Steps and time."""
        steps = (
            f"{self.agent_steps:,} agent steps"
            if self.agent_steps or not self.gradient_steps
            else f"{self.gradient_steps:,} gradient steps"
        )
        return f"{steps}, {duration(self.seconds)}"

    def __str__(self) -> str:
        if self.state == "not begun":
            return self.state
        if self.state == "failed":
            return f"failed after {self.far}: {self.error}"
        return f"done: {self.far}" if self.state == "done" else self.far


def run_state(directory: Path) -> RunState:
    """The state of the run in a directory.

    Its report is the last thing a run writes; but `bootifol report` writes one of a run in progress, too.
    """
    error = error_file(directory)
    state: State = "not begun"
    if (directory / "report.html").is_file() and _is_finished(directory):
        state = "done"
    elif error.is_file():
        state = "failed"
    elif (directory / "config.json").is_file():
        state = "begun"
    sentence = error.read_text().strip() if state == "failed" else ""
    return RunState(state, *progress_of(directory), sentence)


def _is_finished(directory: Path) -> bool:
    return (directory / "config.json").is_file() and unfinished_because(read_run(directory)) is None


def progress_of(directory: Path) -> tuple[int, int, float]:
    """Gradient steps, agent steps and seconds by the last whole lines of metrics.jsonl."""
    counts, seconds = {"gradient_step": 0, "agent_steps": 0}, 0.0
    metrics = directory / "metrics.jsonl"
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


def check_is_planned(run: PlannedRun, directory: Path) -> None:
    """A run goes on as it was begun, so it must have been begun as the sweep has it now.

    Args:
        run: of the sweep.
        directory: where it was begun, if it was.

    Raises:
        BootifolError: another run is there.
    """
    if not (directory / "config.json").is_file():
        return
    there = read_json(directory / "config.json", "the run's configuration", editable=True)
    wanted = {"task": run.task, "method": run.method, "preset": run.preset, "seed": run.seed}
    found = {name: there.get(name) for name in wanted}
    if run.method != RANDOM:  # which learns nothing, and has no budget
        # What JSON makes of it, as it was written there.
        planned, default = (
            decisive(json.loads(json.dumps(dataclasses.asdict(config))), run.method)
            for config in (run.config, TrainingConfig())
        )
        # A run that is older than a field was made as the field's default says.
        written = default | decisive(with_todays_names(there.get("config", {})), run.method)
        wanted |= {"time_budget": run.seconds, **planned}
        found |= {"time_budget": there.get("time_budget"), **written}
    for name, value in wanted.items():
        if found[name] != value:
            raise BootifolError(
                f"{directory} was begun with {name} {found[name]}, and the sweep has {value}: choose another --out, or "
                "what it was begun with; if the sweep has changed since, remove the run, and it is run again"
            )
