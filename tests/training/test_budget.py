from __future__ import annotations

import pytest

from bootifol.errors import BootifolError
from bootifol.training.budget import Budget, Counters, parse_duration


@pytest.mark.parametrize(
    ("text", "seconds"), [("90s", 90), ("45m", 2700), ("1.5h", 5400), ("1h30m", 5400), ("1h1m1s", 3661)]
)
def test_durations(text: str, seconds: float) -> None:
    assert parse_duration(text) == seconds


@pytest.mark.parametrize("text", ["", "90", "1d", "h", "-5m", "1h 30m"])
def test_a_wrong_duration_gets_a_sentence(text: str) -> None:
    with pytest.raises(BootifolError, match="is not a duration; write it like 90s"):
        parse_duration(text)


def test_without_a_time_budget_schedules_follow_agent_steps() -> None:
    budget = Budget(agent_steps=1000, alignment_steps=5)
    counters = Counters(agent_steps=400, interactive_seconds=1e9)
    assert budget.scheduled_steps(counters) == 400
    assert not budget.ended(counters)
    assert budget.ended(Counters(agent_steps=1000))


def test_with_a_time_budget_schedules_are_stretched_over_what_alignment_left() -> None:
    budget = Budget(agent_steps=1000, seconds=100.0, alignment_steps=50, alignment_fraction=0.2)
    counters = Counters(agent_steps=7, alignment_seconds=20.0, interactive_seconds=40.0)
    assert budget.scheduled_steps(counters) == 500
    assert not budget.ended(counters)
    assert budget.ended(Counters(agent_steps=7, alignment_seconds=20.0, interactive_seconds=81.0))


def test_cloning_takes_its_time_and_moves_no_schedule() -> None:
    budget = Budget(agent_steps=1000, seconds=100.0)
    before = Counters(interactive_seconds=0.1)
    assert budget.scheduled_steps(before) == 1
    assert budget.scheduled_steps(Counters(interactive_seconds=0.1, cloning_seconds=50.0)) == 2
    assert budget.scheduled_steps(Counters(interactive_seconds=25.0, cloning_seconds=50.0)) == 500
    assert budget.ended(Counters(interactive_seconds=0.1, cloning_seconds=100.0))
    assert Counters(alignment_seconds=1.0, interactive_seconds=2.0, cloning_seconds=4.0).seconds == 7.0


def test_progress_counts_steps_or_with_a_time_budget_seconds() -> None:
    counters = Counters(alignment_steps=3, agent_steps=7, alignment_seconds=20.0, interactive_seconds=41.5)
    steps = Budget(agent_steps=1000, alignment_steps=50)
    assert steps.alignment_extent(counters) == ("gradient steps", 3, 50)
    assert steps.interactive_extent(counters) == ("agent steps", 7, 1000)
    seconds = Budget(agent_steps=1000, seconds=100.0, alignment_steps=50, alignment_fraction=0.25)
    assert seconds.alignment_extent(counters) == ("seconds", 20, 25)
    assert seconds.interactive_extent(counters) == ("seconds", 41, 80)


def test_alignment_ends_with_its_steps_or_its_share_of_the_time() -> None:
    budget = Budget(agent_steps=1000, seconds=100.0, alignment_steps=50, alignment_fraction=0.2)
    assert not budget.alignment_ended(Counters(alignment_steps=49, alignment_seconds=19.9))
    assert budget.alignment_ended(Counters(alignment_steps=50))
    assert budget.alignment_ended(Counters(alignment_steps=3, alignment_seconds=20.0))
