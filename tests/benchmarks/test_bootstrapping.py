"""What is said of a head that was bootstrapped, on rewards chosen by hand."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.bootstrapping import Played, figures

from bootifol.errors import BootifolError
from bootifol.rewards.bootifol.frames.config import FrameConfig
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.types import FrameStates, Rewards

LEVEL = 10.0


class Linear(FrameRewardModel):
    """Rewards a state with its first number."""

    def score(self, states: FrameStates) -> Rewards:
        return states[:, 0].astype(np.float32)


MODEL = Linear(FrameConfig(width=8), 32, seed=1)


def states_of(values: list[int]) -> FrameStates:
    states = np.zeros((len(values), MODEL.feature_size), np.int8)
    states[:, 0] = values
    return states


def played(learned: list[int], true: list[float]) -> Played:
    """One episode of 20 repeats of these steps."""
    rewards = np.tile(np.array(true, np.float32), 20)
    return Played(np.tile(states_of(learned), (20, 1))[None], rewards[None], LEVEL)


def test_successes_and_failures_are_what_the_environment_says() -> None:
    """0.8 of the level is a success, below half of it a failure, and what lies between is neither."""
    found = figures(MODEL, played([4, 3, 100, 1, 5], [10, 8, 7, 4, 0]), states_of([6, 2]))
    assert found["expert"] == 4
    assert found["success"] == pytest.approx(3.5)
    assert found["failure"] == pytest.approx(3)
    assert found["success_above_failure"] == 0.5, "4 and 3 are above 1, and below 5"
    assert found["expert_above_success"] == 0.5, "6 is above both, 2 below both"


def test_a_reward_that_orders_as_the_environment_does_has_rank_correlation_1() -> None:
    assert figures(MODEL, played([1, 2, 3], [1, 8, 10]), states_of([1]))["spearman"] == pytest.approx(1)


def test_a_policy_without_successes_is_refused() -> None:
    with pytest.raises(BootifolError, match="0 are successes and 40 failures"):
        figures(MODEL, played([1, 2], [0, 0]), states_of([1]))
