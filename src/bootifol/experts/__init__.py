"""Who performs: scripted experts, and the other behaviors that recordings and rankings need."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from bootifol.envs.drawn import SPEED
from bootifol.envs.rollout import Act
from bootifol.errors import BootifolError
from bootifol.experts import reacher
from bootifol.experts.behaviors import Behavior, Controller, HalfGood, no_actions, random_actions
from bootifol.types import Action

__all__ = ["Behavior", "make_behavior", "make_expert", "make_random"]

WrongGoal = Callable[[np.random.Generator], NDArray[np.float64]]


def make_expert(task_name: str, environment: gymnasium.Env[Any, Any]) -> Act:
    """The task's expert, which reads the simulator's state instead of the picture.

    Raises:
        BootifolError: the task has none.
    """
    controller, _ = _script(task_name, environment)
    return lambda observation: controller(None)


def make_random(environment: gymnasium.Env[Any, Any], seed: int) -> Act:
    """Uniformly random actions."""
    return random_actions(_action_dim(environment), seed)


def make_behavior(behavior: Behavior, task_name: str, environment: gymnasium.Env[Any, Any], seed: int) -> Act:
    """Whoever acts in a recording; make one for every episode.

    Args:
        behavior: expert, half_good, random or still.
        task_name: from the catalogue.
        environment: what it acts in.
        seed: of everything random about it.
    """
    if behavior == "expert":
        return make_expert(task_name, environment)
    if behavior == "random":
        return make_random(environment, seed)
    if behavior == "still":
        return no_actions(_action_dim(environment))
    if behavior == "half_good":
        controller, wrong_goal = _script(task_name, environment)
        return HalfGood(controller, environment, seed, wrong_goal)
    raise BootifolError(
        f"there is no behavior '{behavior}'; choose among expert, half_good, random and still"
    )


def _script(task_name: str, environment: gymnasium.Env[Any, Any]) -> tuple[Controller, WrongGoal | None]:
    """A task's scripted controller, and how to draw a wrong goal for it."""
    simulator: Any = environment.unwrapped.simulator  # type: ignore[attr-defined]
    if task_name == "reacher_hard":

        def reach(goal: NDArray[np.float64] | None) -> Action:
            where = reacher.target_position(simulator.physics) if goal is None else goal
            return reacher.torques(simulator.physics, where)

        def wrong_place(rng: np.random.Generator) -> NDArray[np.float64]:
            # The suite draws targets 0.05 to 0.20 m from the center, so a point on the far side, 0.08 m or more from
            # the center, is at least 0.12 m away from any.
            angle = rng.uniform(-np.pi / 4, np.pi / 4)
            opposite = -reacher.target_position(simulator.physics)
            direction = np.arctan2(opposite[1], opposite[0]) + angle
            return rng.uniform(0.08, 0.2) * np.array([np.cos(direction), np.sin(direction)])

        return reach, wrong_place
    if task_name == "drawn_reach":

        def move(goal: NDArray[np.float64] | None) -> Action:
            away = (simulator.target if goal is None else goal) - simulator.dot
            action: Action = np.clip(away / SPEED, -1.0, 1.0).astype(np.float32)
            return action

        def wrong_spot(rng: np.random.Generator) -> NDArray[np.float64]:
            spot = rng.uniform(-0.9, 0.9, 2)
            while np.hypot(*(spot - simulator.target)) < 0.6:
                spot = rng.uniform(-0.9, 0.9, 2)
            return spot

        return move, wrong_spot
    raise BootifolError(f"there is no expert for the task {task_name}; import videos of it instead")


def _action_dim(environment: gymnasium.Env[Any, Any]) -> int:
    assert isinstance(environment.action_space, gymnasium.spaces.Box)
    return environment.action_space.shape[0]
