"""What a time budget buys: arithmetic of what was measured, and that measuring changes nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_runs import RUNS, TINY, new_run

from bootifol.training.budget import Budget, Counters
from bootifol.training.config import TrainingConfig
from bootifol.training.forecast import Costs, Forecast, affordable_steps, forecast


def test_steps_are_what_the_seconds_pay_for() -> None:
    config = replace(
        TINY,
        agent=replace(TINY.agent, update_every=2, warm_up_steps=0),
        interactive=replace(
            TINY.interactive, agent_steps=1000, reward_updates_until=500, reward_update_every=10
        ),
        evaluation=replace(TINY.evaluation, every=100),
    )
    costs = Costs(agent_step=0.01, update=0.02, reward_update=0.2)
    # At rest 0.01 and a half of 0.02; while the reward learns, in half the time, a tenth of 0.2 more.
    assert affordable_steps(costs, config, 100.0, evaluated=0) == 50 / 0.04 + 50 / 0.02
    assert affordable_steps(costs, config, 100.0, evaluated=200) == int(50 / 0.06 + 50 / 0.04)
    # 1000 steps of a warm-up, in which nothing learns, are 10 of 110 seconds.
    warming_up = replace(config, agent=replace(config.agent, warm_up_steps=1000))
    assert affordable_steps(costs, warming_up, 110.0, evaluated=0) == 1000 + 50 / 0.04 + 50 / 0.02
    assert affordable_steps(costs, warming_up, 5.0, evaluated=0) == 500


def test_little_is_told_with_what_would_be_enough() -> None:
    enough = Forecast(seconds=600.0, agent_steps=10_000, updates=4000, wanted_steps=30_000)
    assert not enough.little
    assert "10 min 00 s" in enough.in_words() and "10,000 agent steps and 4,000 updates" in enough.in_words()
    assert "little" not in enough.in_words()
    little = replace(enough, agent_steps=3000)
    assert little.little
    assert "about 1 h 40 min here, so give a longer --time-budget" in little.in_words()


@pytest.mark.parametrize(("method", "config"), RUNS)
def test_measuring_changes_nothing_of_the_run(
    method: str, config: TrainingConfig, tmp_path: Path, demos: Path
) -> None:
    run = new_run(tmp_path / "run", demos, method, config)
    before = {name: part.state() for name, part in run.parts.stateful().items()}
    budget = Budget(config.interactive.agent_steps, 60.0, cloning_fraction=0.1)
    told = forecast(
        replace(run.config, time_budget=60.0), run.parts, budget, Counters(alignment_seconds=10.0)
    )
    phases = config.demonstrations.phases if run.parts.demonstrations else 0
    assert told.seconds == pytest.approx(60.0 - 10.0 - 6.0 * phases)
    assert told.agent_steps > 0 and told.updates >= 0
    for name, part in run.parts.stateful().items():
        for key, array in part.state().items():
            np.testing.assert_array_equal(array, before[name][key], err_msg=f"{name}/{key}")
