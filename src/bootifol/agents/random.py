"""An agent that ignores what it sees: the lower end of the scale."""

from __future__ import annotations

import numpy as np

from bootifol.types import Action, Observation


class RandomAgent:
    """Uniformly random actions behind the `act` of every agent.

    Args:
        action_dim: action dimensions.
        seed: of the actions.
    """

    def __init__(self, action_dim: int, seed: int) -> None:
        self._action_dim = action_dim
        self._rng = np.random.default_rng(seed)

    def act(self, observation: Observation, agent_steps: float, explore: bool) -> Action:
        """Float32 `[A]` drawn uniformly from [-1, 1]; the arguments are ignored."""
        return self._rng.uniform(-1.0, 1.0, self._action_dim).astype(np.float32)
