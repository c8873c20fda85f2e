"""Who acts in a recording: the expert, someone half as good, someone random, no one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import gymnasium
import numpy as np
from numpy.typing import NDArray

from bootifol.envs.rollout import Act
from bootifol.types import Action, Observation

Behavior = Literal["expert", "half_good", "random", "still"]

Controller = Callable[[NDArray[np.float64] | None], Action]
"""A scripted controller: the action toward the task's own goal (None) or toward another point of its space."""

WrongGoal = Callable[[np.random.Generator], NDArray[np.float64]]
"""Draws a point that is far from the goal of the episode that the simulator shows."""


class HalfGood:
    """Does something right but not the task; each episode is one of three kinds, drawn from its seed.

    - the expert until a third of the episode, then random actions;
    - random actions three steps of four, the expert's in between;
    - a steady reach to a wrong place, or, of an expert that knows only the task's own goal, its actions at a
      third of their strength.

    Args:
        controller: the task's expert.
        environment: what it acts in.
        seed: of the kinds and of the noise.
        wrong_goal: draws a wrong place, called once, at the first step; None if there is no other goal.
    """

    def __init__(
        self,
        controller: Controller,
        environment: gymnasium.Env[Any, Any],
        seed: int,
        wrong_goal: WrongGoal | None,
    ) -> None:
        self._controller = controller
        self._steps_of_an_episode: int = environment.unwrapped.episode_steps  # type: ignore[attr-defined]
        self._rng = np.random.default_rng([seed, 3])
        self._action_dim = environment.action_space.shape[0]  # type: ignore[index]
        self._kind = int(self._rng.integers(3))
        self._wrong_goal = wrong_goal
        self._goal: NDArray[np.float64] | None = None
        self._step = 0

    def __call__(self, observation: Observation) -> Action:
        """One action; the observation is not needed."""
        if self._step == 0 and self._wrong_goal is not None:
            # Only now does the simulator show this episode's start.
            self._goal = self._wrong_goal(self._rng)
        self._step += 1
        noise = self._rng.uniform(-1.0, 1.0, self._action_dim).astype(np.float32)
        if self._kind == 0:
            return self._controller(None) if self._step <= self._steps_of_an_episode // 3 else noise
        if self._kind == 1:
            return noise if self._rng.random() < 0.75 else self._controller(None)
        if self._goal is None:
            weak: Action = self._controller(None) * np.float32(1 / 3)
            return weak
        return self._controller(self._goal)


def random_actions(action_dim: int, seed: int) -> Act:
    """Uniformly random actions in [-1, 1]."""
    rng = np.random.default_rng([seed, 4])
    return lambda observation: rng.uniform(-1.0, 1.0, action_dim).astype(np.float32)


def no_actions(action_dim: int) -> Act:
    """Zeros."""
    return lambda observation: np.zeros(action_dim, np.float32)
