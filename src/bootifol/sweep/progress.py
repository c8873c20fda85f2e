"""What a sweep shows: a live table on a terminal, elsewhere a line whenever something changes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from bootifol.progress import duration
from bootifol.sweep.beside import Place
from bootifol.sweep.planned import RANDOM, PlannedRun
from bootifol.sweep.run_state import RunState

_ORDER = ("running", "failed", "waiting", "stopped", "done")
"""From the first row of the table to the last."""
_BESIDE_ROWS = 7
"""Lines of the terminal that are no rows of the table."""


@dataclass
class Job:
    """A run of the sweep, and how far it is."""

    run: PlannedRun
    directory: Path
    state: RunState
    place: Place | None = None
    """Where it is going on."""
    pending: bool = False
    """Whether Ray has it."""
    agent_steps: int = field(init=False)
    """In all."""

    def __post_init__(self) -> None:
        self.agent_steps = self.run.config.interactive.agent_steps

    @property
    def status(self) -> str:
        """One of `_ORDER`."""
        if self.pending:
            return "waiting" if self.place is None else "running"
        return self.state.state if self.state.state in ("done", "failed") else "stopped"

    @property
    def fraction(self) -> float:
        """Of its learning that is done, from 0 to 1."""
        if self.state.state == "done":
            return 1.0
        if self.run.seconds is not None:
            return min(self.state.seconds / max(self.run.seconds, 1e-9), 1.0)
        return min(self.state.agent_steps / self.agent_steps, 1.0)


def seconds_left(jobs: Sequence[Job], at_once: int) -> float | None:
    """Seconds until all have learned; None where nothing has been learned yet.

    Without a time budget, a run takes as long as those of its task and method do, or else as the others do, by how far
    they have come.

    Args:
        jobs: all.
        at_once: how many learn side by side.
    """

    def whole(job: Job) -> float | None:
        """Seconds of its learning in all, if it goes on as it went."""
        if job.run.seconds is not None:
            return job.run.seconds
        return job.state.seconds / job.fraction if job.fraction and job.state.seconds else None

    known = [(job.run, seconds) for job in jobs if (seconds := whole(job)) is not None]
    left = 0.0
    for job in jobs:
        if not job.pending or job.run.method == RANDOM:
            continue
        alike = [
            seconds for run, seconds in known if (run.task, run.system) == (job.run.task, job.run.system)
        ]
        others = [seconds for _, seconds in known]
        if (expected := whole(job)) is None:
            if not others:
                return None
            expected = mean(alike or others)
        left += max(expected - job.state.seconds, 0.0)
    return left / max(at_once, 1)


class Board:
    """Shows the jobs.

    Args:
        jobs: all, in their order.
        console: where.
    """

    def __init__(self, jobs: Sequence[Job], console: Console) -> None:
        self.jobs = jobs
        self.console = console
        self._live: Live | None = None
        self._at_once = 0

    @contextmanager
    def shown(self) -> Iterator[None]:
        """While entered, a terminal shows the table."""
        if not self.console.is_terminal:
            yield
            return
        with Live(
            self.table(), console=self.console, auto_refresh=False, redirect_stdout=False
        ) as self._live:
            yield

    def update(self) -> None:
        """Shows how far the jobs are now."""
        if self._live is not None:
            self._live.update(self.table(), refresh=True)

    def say(self, job: Job, what: str, more: str = "", important: bool = False) -> None:
        """A line about a job; on a terminal, whose table shows the rest, only what is important."""
        if self._live is None or important:
            self.print(f"{what:10} {job.run.name}{f': {more}' if more else ''}; {self.summary()}")

    def print(self, line: str) -> None:
        """A line, above the table where there is one."""
        self.console.print(line, markup=False, highlight=False, emoji=False, soft_wrap=True)

    def summary(self) -> str:
        """How many jobs are in which state, and how long the rest takes."""
        states = [job.status for job in self.jobs]
        self._at_once = max(self._at_once, states.count("running"))
        counts = [f"{states.count(state)} {state}" for state in _ORDER if state in states]
        left = seconds_left(self.jobs, self._at_once)
        pending = any(job.pending for job in self.jobs)
        return ", ".join(counts) + (f", about {duration(left)} left" if pending and left else "")

    def table(self) -> Table:
        """As many jobs as the terminal has lines for, those that are going on first."""
        table = Table("run", "state", "learned", "so far", "where", box=None, caption_justify="left")
        ordered = sorted(self.jobs, key=lambda job: _ORDER.index(job.status))
        for job in ordered[: max(self.console.height - _BESIDE_ROWS, 1)]:
            state = job.state
            begun = state.gradient_steps or state.agent_steps or state.state == "done"
            table.add_row(
                Text(job.run.name),
                Text(job.status, style={"failed": "red", "done": "green"}.get(job.status, "")),
                f"{job.fraction:.0%}" if begun else "",
                Text(state.error if job.status == "failed" else state.far if begun else ""),
                Text(job.place.host if job.place is not None else ""),
            )
        table.caption = Text(self.summary())
        return table
