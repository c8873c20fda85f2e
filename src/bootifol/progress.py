"""How far a long job is: a bar with count, rate and remaining time; plain lines outside a terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

_SECONDS_BETWEEN_LINES = 30.0


class Advance(Protocol):
    """Counts `n` more units as done and shows the latest named values beside the bar."""

    def __call__(self, n: int = 1, **shown: float | str) -> None: ...


@contextmanager
def progress(description: str, total: int, done: int = 0, unit: str = "") -> Iterator[Advance]:
    """Shows progress on standard error while the block runs.

    On a terminal this is a bar; elsewhere one line at the start, one every 30 seconds and one at the end,
    so that logs stay short.

    Args:
        description: what is being done, such as "recording expert".
        total: units of the whole job.
        done: units finished before this call (a resumed job); they do not count in the rate.
        unit: what is counted, such as "agent steps"; of "seconds" there is no rate.

    Yields:
        `advance(n=1, **shown)`; for example `advance(1, loss=0.31)`.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        lines = _Lines(description, total, done, unit)
        try:
            yield lines.advance
        finally:
            lines.print()
        return

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        _Count(unit),
        _RateAndRemaining(unit),
        TextColumn("{task.fields[shown]}", style="dim", markup=False),
        console=console,
    )
    task = bar.add_task(description, total=total, completed=done, shown="")
    latest: dict[str, float | str] = {}

    def advance(n: int = 1, **shown: float | str) -> None:
        latest.update(shown)
        bar.update(task, advance=n, shown=_shown(latest))

    with bar:
        yield advance


def duration(seconds: float) -> str:
    """A length of time as people say it: `8 s`, `3 min 20 s`, `2 h 05 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60:02d} min"


class _Count(ProgressColumn):
    """`160/400 gradient steps`."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self.unit = unit

    def render(self, task: Task) -> Text:
        return Text(_count(task.completed, task.total or 0, self.unit), style="progress.download")


class _RateAndRemaining(ProgressColumn):
    """`12.1/s, 3 min 20 s left`, from the last half minute."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self.unit = unit

    def render(self, task: Task) -> Text:
        if task.finished:
            return Text(f"in {duration(task.finished_time or 0.0)}")
        if not task.speed or task.remaining is None:
            return Text("")
        return Text(_rate_and_remaining(task.speed, task.remaining, self.unit))


class _Lines:
    """The plain variant: prints the state of the job at most every 30 seconds."""

    def __init__(self, description: str, total: int, done: int, unit: str) -> None:
        self.description = description
        self.total = total
        self.count = self.count_before = done
        self.unit = unit
        self.latest: dict[str, float | str] = {}
        self.started = self.printed = time.monotonic()
        print(f"{description}: {_count(done, total, unit)}", file=sys.stderr, flush=True)

    def advance(self, n: int = 1, **shown: float | str) -> None:
        self.count += n
        self.latest.update(shown)
        if time.monotonic() - self.printed >= _SECONDS_BETWEEN_LINES:
            self.print()

    def print(self) -> None:
        self.printed = time.monotonic()
        seconds = self.printed - self.started
        rate = (self.count - self.count_before) / max(seconds, 1e-9)
        parts = [f"{self.description}: {_count(self.count, self.total, self.unit)}"]
        if self.count >= self.total:
            parts.append(f"done in {duration(seconds)}")
        elif rate > 0:
            parts.append(_rate_and_remaining(rate, self.total - self.count, self.unit))
        if self.latest:
            parts.append(_shown(self.latest))
        print(", ".join(parts), file=sys.stderr, flush=True)


def _count(done: float, total: float, unit: str) -> str:
    if unit == "seconds":
        return f"{duration(done)} of {duration(total)}"
    return f"{done:.0f}/{total:.0f} {unit}".rstrip()


def _rate_and_remaining(rate: float, remaining: float, unit: str) -> str:
    if unit == "seconds":
        return f"{duration(remaining)} left"
    return f"{_rate(rate)}, {duration(remaining / rate)} left"


def _rate(per_second: float) -> str:
    if per_second >= 1:
        return f"{per_second:.3g}/s" if per_second < 1000 else f"{per_second:,.0f}/s"
    return f"{1 / per_second:.3g} s each"


def _shown(values: dict[str, float | str]) -> str:
    return " ".join(
        f"{name}={value:.4g}" if isinstance(value, float) else f"{name}={value}"
        for name, value in values.items()
    )
