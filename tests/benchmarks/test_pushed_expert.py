from itertools import islice
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
from benchmarks.any_environment import Example, pushed, swing_up


def actions_of(pushes: float, count: int) -> np.ndarray:
    """Of an expert that does nothing, in actions between 1 and 2."""
    example = Example("a:b", lambda _: np.zeros(1), action_repeat=2, episode_steps=count, pushes=pushes)
    environment: Any = SimpleNamespace(
        action_space=gymnasium.spaces.Box(1.0, 2.0, (1,), np.float64), unwrapped=None
    )
    return np.concatenate(list(islice(pushed(example, environment, np.random.default_rng(0)), 2 * count)))


def test_a_push_lasts_one_to_three_agent_steps() -> None:
    assert not actions_of(0.0, 50).any()
    first, second = actions_of(0.2, 500).reshape(-1, 2).T
    np.testing.assert_array_equal(first, second, "an agent step repeats its action")
    random = first > 0
    assert 0.2 < random.mean() < 0.5, "a push of 2 agent steps in the mean begins in a fifth of those without"
    lengths = [len(run) for run in "".join("x" if pushed else " " for pushed in random).split()]
    assert min(lengths) == 1 and np.median(lengths) <= 3
    always = actions_of(1.0, 500).reshape(-1, 2)[:, 0]
    assert (always > 0).all() and 160 < len(np.unique(always)) < 500


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_pendulums_expert_pushes_the_less_the_less_energy_is_missing(side: float) -> None:
    def torque(angle: float, velocity: float) -> float:
        state = np.array([angle, side * velocity])
        pendulum = SimpleNamespace(state=state, g=10.0, m=1.0, l=1.0, max_torque=2.0)
        return side * float(swing_up(pendulum)[0])

    assert torque(np.pi, 1.0) == 2.0, "at the bottom, with the motion"
    assert 0.0 < torque(np.pi, 7.6) < 2.0
    assert torque(np.pi, 8.0) < 0.0, "too much energy is taken out"
    assert torque(0.1 * side, 0.0) == pytest.approx(-1.2), "near the top a spring holds it"
