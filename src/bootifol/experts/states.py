"""A task as its expert sees it: states instead of pictures. Nothing is rendered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.tasks import make_environment
from bootifol.types import Action

State = NDArray[np.float32]

POTENTIALS: dict[str, Callable[[Any], float]] = {"hopper_stand": lambda physics: float(physics.height())}
"""What rises on the way to a task whose reward is 0 until it is done: Hopper's torso over its foot, in meters."""


class StateEnvironment(gymnasium.Env[State, Action]):
    """A task behind the Gymnasium API, with the simulator's state `[S]` as observation.

    Args:
        task_name: from the catalogue; its simulator must have a method `state`.
        episode_steps: agent steps after which an episode is truncated.
        shaping: weight w of a potential Φ in the reward, which becomes r + w (γ Φ(s') - Φ(s)); that changes which way
            is found first and not which is best (Ng, Harada and Russell, 1999). 0 leaves the task's reward alone.
        discount: γ in it, the learner's.

    Raises:
        BootifolError: unknown task, its simulator shows no state, or shaping where `POTENTIALS` has none.
    """

    def __init__(
        self, task_name: str, episode_steps: int, shaping: float = 0.0, discount: float = 1.0
    ) -> None:
        if shaping and task_name not in POTENTIALS:
            raise BootifolError(
                f"{task_name} has no potential to shape its reward with; {', '.join(POTENTIALS)} has"
            )
        pictures = PictureConfig(agent_size=8, video_size=8, stack=1)
        self._environment = make_environment(task_name, pictures, episode_steps)
        self._environment.rendered = False
        simulator: Any = self._environment.simulator
        if not hasattr(simulator, "state"):
            raise BootifolError(
                f"{task_name} has no states to train an expert from; tasks of DeepMind Control have"
            )
        self._simulator = simulator
        self._potential = POTENTIALS[task_name] if shaping else None
        self._shaping, self._discount = shaping, discount
        simulator.reset(0)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, simulator.state().shape, np.float32)
        self.action_space = self._environment.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[State, dict[str, Any]]:
        """Starts an episode; a seed gives the start that it gives with pictures."""
        super().reset(seed=seed)
        self._environment.reset(seed=seed)
        return self._simulator.state(), {}

    def step(self, action: Action) -> tuple[State, float, bool, bool, dict[str, Any]]:
        """One agent step; the rewards of the repeated action are summed."""
        before = self._potential_now()
        _, reward, terminated, truncated, _ = self._environment.step(action)
        reward += self._shaping * (self._discount * self._potential_now() - before)
        return self._simulator.state(), reward, terminated, truncated, {}

    def _potential_now(self) -> float:
        return 0.0 if self._potential is None else self._potential(self._simulator.physics)

    def close(self) -> None:
        self._environment.close()
