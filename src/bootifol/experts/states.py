"""A task as its expert sees it: states instead of pictures. Nothing is rendered."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.tasks import task_named
from bootifol.types import Action

State = NDArray[np.float32]


class StateEnvironment(gymnasium.Env[State, Action]):
    """A task behind the Gymnasium API, with the simulator's state `[S]` as observation.

    Args:
        task_name: from the catalogue; its simulator must have a method `state`.
        episode_steps: agent steps after which an episode is truncated.

    Raises:
        BootifolError: unknown task, or its simulator shows no state.
    """

    def __init__(self, task_name: str, episode_steps: int) -> None:
        task = task_named(task_name)
        self.simulator: Any = task.make_simulator(PictureConfig())
        if not hasattr(self.simulator, "state"):
            raise BootifolError(
                f"{task_name} has no states to train an expert from; tasks of DeepMind Control have"
            )
        self.action_repeat = task.action_repeat
        self.episode_steps = episode_steps
        self.simulator.reset(0)
        shape = self.simulator.state().shape
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, shape, np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self.simulator.action_dim,), np.float32)
        self._agent_steps = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[State, dict[str, Any]]:
        """Starts an episode; a seed gives the start that it gives in `PixelEnvironment`."""
        super().reset(seed=seed)
        self.simulator.reset(int(self.np_random.integers(2**31)) if seed is None else seed)
        self._agent_steps = 0
        return self.simulator.state(), {}

    def step(self, action: Action) -> tuple[State, float, bool, bool, dict[str, Any]]:
        """One agent step; the rewards of the repeated action are summed."""
        reward, terminated = 0.0, False
        clipped = np.clip(action, -1.0, 1.0)
        for _ in range(self.action_repeat):
            step_reward, terminated, _ = self.simulator.step(clipped)
            reward += step_reward
            if terminated:
                break
        self._agent_steps += 1
        return self.simulator.state(), reward, terminated, self._agent_steps >= self.episode_steps, {}

    def close(self) -> None:
        self.simulator.close()
