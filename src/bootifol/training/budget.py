"""How far a run is, and how far it may go: in agent steps, or in wall-clock time."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from bootifol.errors import BootifolError
from bootifol.types import StepMetrics


@dataclass
class Counters:
    """What has been done so far, over all sessions of a run."""

    alignment_steps: int = 0
    agent_steps: int = 0
    episodes: int = 0
    agent_updates: int = 0
    reward_updates: int = 0
    evaluations: int = 0
    to_evaluate: int = 0
    """1 where an evaluation is due that the run was stopped before or in."""
    to_rank: int = 0
    """1 from the first step of alignment until held-out videos were ranked after its last."""
    cloning_phases: int = 0
    """Begun so far."""
    cloning_began_at: int = 0
    """Agent steps when the last Cloning Phase began."""
    cloning_steps: int = 0
    """In all Cloning Phases (`cloning.steps_of_a_phase`), those included that time left no room for."""
    cloning_gradient_steps: int = 0
    """Those of them that learn: of the inverse dynamics and of the clone."""
    alignment_seconds: float = 0.0
    """Wall-clock time spent in the Alignment Phase."""
    interactive_seconds: float = 0.0
    """Wall-clock time spent in the Interactive Phase, evaluations included."""
    cloning_seconds: float = 0.0
    """Wall-clock time spent in Cloning Phases."""
    cloning_seconds_before: float = 0.0
    """Of that, what was spent before the last Cloning Phase began."""

    def as_json(self) -> dict[str, float]:
        return asdict(self)

    @property
    def seconds(self) -> float:
        return self.alignment_seconds + self.interactive_seconds + self.cloning_seconds


@dataclass(frozen=True)
class PhaseStep:
    """What a phase tells the trainer after each of its steps."""

    count: int
    """How far the phase is, as its log lines count it: in gradient steps or agent steps."""
    done: int
    """How far it is in the unit of its progress bar."""
    metrics: Sequence[StepMetrics]
    """Of each update since the last step."""
    log_is_due: bool
    """Whether a line of means is to be logged now."""


class Stopwatch:
    """Adds the wall-clock time since the last `lap` to a counter."""

    def __init__(self) -> None:
        self._since = time.monotonic()

    def lap(self) -> float:
        now = time.monotonic()
        elapsed, self._since = now - self._since, now
        return elapsed


@dataclass(frozen=True)
class Budget:
    """What a run may spend.

    Without a time limit, schedules follow agent steps and a run is reproducible bit for bit. With one, they are
    stretched over the time there is for acting: a quarter of the way into it, the noise stands where it would stand
    a quarter of the way into `agent_steps`. What Alignment and Cloning Phases take is not there for acting, so that the
    end of a Cloning Phase finds schedules a little further on.
    """

    agent_steps: int
    """N_π: the agent steps that schedules are written for."""

    seconds: float | None = None
    """Wall-clock time for the whole run, or None."""

    alignment_steps: int = 0
    """N_pretrain."""

    alignment_fraction: float = 0.0
    """Largest fraction of `seconds` for the Alignment Phase."""

    cloning_fraction: float = 0.0
    """Largest fraction of `seconds` for one Cloning Phase."""

    def alignment_ended(self, counters: Counters) -> bool:
        if counters.alignment_steps >= self.alignment_steps:
            return True
        return (
            self.seconds is not None and counters.alignment_seconds >= self.alignment_fraction * self.seconds
        )

    def cloning_passed(self, counters: Counters) -> float:
        """What fraction of the last Cloning Phase's time has passed, 1 where it is over; without a limit 0, always."""
        if self.seconds is None:
            return 0.0
        passed = counters.cloning_seconds - counters.cloning_seconds_before
        return min(passed / max(self.cloning_fraction * self.seconds, 1e-9), 1.0)

    def scheduled_steps(self, counters: Counters) -> int:
        """Where schedules stand, in agent steps from 0 to N_π."""
        if self.seconds is None:
            return counters.agent_steps
        available = max(self.seconds - counters.alignment_seconds - counters.cloning_seconds, 1e-9)
        return min(int(self.agent_steps * counters.interactive_seconds / available), self.agent_steps)

    def seconds_left(self, counters: Counters) -> float:
        """Wall-clock time left; without a limit, no end of it."""
        return math.inf if self.seconds is None else self.seconds - counters.seconds

    def alignment_extent(self, counters: Counters) -> tuple[str, int, int]:
        """What the Alignment Phase counts, how much is done, and how much there is: gradient steps or seconds."""
        if self.seconds is None:
            return "gradient steps", counters.alignment_steps, self.alignment_steps
        return "seconds", int(counters.alignment_seconds), round(self.alignment_fraction * self.seconds)

    def interactive_extent(self, counters: Counters) -> tuple[str, int, int]:
        """The same of the Interactive Phase: agent steps or seconds."""
        if self.seconds is None:
            return "agent steps", counters.agent_steps, self.agent_steps
        available = self.seconds - counters.alignment_seconds - counters.cloning_seconds
        return "seconds", int(counters.interactive_seconds), round(available)

    def ended(self, counters: Counters) -> bool:
        return self.scheduled_steps(counters) >= self.agent_steps


def parse_duration(text: str) -> float:
    """Seconds in a duration such as "90s", "45m", "1.5h" or "1h30m".

    Raises:
        BootifolError: it is none of these.
    """
    units = {"s": 1, "m": 60, "h": 3600}
    if not re.fullmatch(r"(\d+(\.\d+)?[smh])+", text):
        raise BootifolError(f"'{text}' is not a duration; write it like 90s, 45m, 1.5h or 1h30m")
    return sum(float(number) * units[unit] for number, _, unit in re.findall(r"(\d+(\.\d+)?)([smh])", text))
