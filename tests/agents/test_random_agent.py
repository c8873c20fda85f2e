from __future__ import annotations

import numpy as np

from bootifol.agents.random import RandomAgent


def test_random_actions_are_uniform_and_seeded() -> None:
    observation = np.zeros((8, 8, 9), dtype=np.uint8)
    agent, same, other = (RandomAgent(3, seed) for seed in (0, 0, 1))
    actions = np.array([agent.act(observation, i, explore=True) for i in range(2000)])
    assert actions.shape == (2000, 3) and actions.dtype == np.float32
    assert np.abs(actions).max() <= 1
    np.testing.assert_allclose(
        np.histogram(actions, bins=4, range=(-1, 1))[0] / actions.size, 0.25, atol=0.02
    )
    np.testing.assert_array_equal(actions[0], same.act(observation, 0, explore=False))
    assert not np.array_equal(actions[0], other.act(observation, 0, explore=True))
