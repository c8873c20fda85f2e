"""The evaluation that speaks for a run."""

from __future__ import annotations

from dataclasses import dataclass

from bootifol.evaluation.summary import Summary, summarize
from bootifol.reports.run_files import RunFiles


@dataclass(frozen=True)
class FinalReturn:
    """The evaluation that speaks for a run: the latest on the longest episodes, scaled ones first."""

    agent_steps: int
    episode_steps: int
    environment_return: Summary
    scaled_return: Summary | None
    successes: int | None
    """Episodes that solved the task, where it says so."""


def final_return(run: RunFiles) -> FinalReturn | None:
    """The evaluation that speaks for a run; None where there is none."""
    lengths = run.episode_lengths(scaled=True) or run.episode_lengths()
    if not lengths:
        return None
    grouped = run.evaluations_of(lengths[-1])
    if not grouped:
        return None
    agent_steps, rows = list(grouped.items())[-1]
    scaled = [row.scaled_return for row in rows if row.scaled_return is not None]
    successes = [row.success for row in rows if row.success is not None]
    return FinalReturn(
        agent_steps=agent_steps,
        episode_steps=lengths[-1],
        environment_return=summarize([row.environment_return for row in rows]),
        scaled_return=summarize(scaled) if scaled else None,
        successes=sum(successes) if successes else None,
    )
