"""Who performs: scripted experts, and the other behaviors that recordings and rankings need."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from bootifol.envs.rollout import Act
from bootifol.errors import BootifolError
from bootifol.experts import drawn_reach, meta_world, reacher
from bootifol.experts.behaviors import (
    Behavior,
    Controller,
    HalfGood,
    WrongGoal,
    no_actions,
    random_actions,
)
from bootifol.experts.policy import StatePolicy
from bootifol.types import Action

BUNDLED = Path(__file__).parent / "bundled"
"""Where `<task>.safetensors` lies for every task whose expert was trained; beside it its curve and settings. Where
there is a `<task>.half_trained.safetensors`, the same training stopped early, it is who plays `half_good`."""

__all__ = ["Behavior", "make_behavior", "make_expert", "make_random"]


def make_expert(task_name: str, environment: gymnasium.Env[Any, Any]) -> Act:
    """The task's expert, which reads the simulator's state instead of the picture.

    Raises:
        BootifolError: the task has none.
    """
    controller, _ = script_of(task_name, environment)
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
        half_trained = BUNDLED / f"{task_name}.half_trained.safetensors"
        if half_trained.exists():
            policy, simulator = StatePolicy.load(half_trained), _simulator(environment)
            return lambda observation: policy(simulator.state())
        controller, wrong_goals = script_of(task_name, environment)
        return HalfGood(controller, environment, seed, wrong_goals.get("wrong_place"))
    raise BootifolError(
        f"there is no behavior '{behavior}'; choose among expert, half_good, random and still"
    )


def script_of(
    task_name: str, environment: gymnasium.Env[Any, Any]
) -> tuple[Controller, dict[str, WrongGoal]]:
    """A task's scripted or bundled controller, and how to draw wrong goals for it, by kind of failure, where it can
    have another."""
    simulator = _simulator(environment)
    bundled = BUNDLED / f"{task_name}.safetensors"
    if bundled.exists():
        policy = StatePolicy.load(bundled)
        return lambda goal: policy(simulator.state()), {}
    if task_name == "reacher_hard":
        physics = simulator.physics

        def reach(goal: NDArray[np.float64] | None) -> Action:
            return reacher.torques(physics, reacher.target_position(physics) if goal is None else goal)

        return reach, {
            "wrong_place": lambda rng: reacher.wrong_place(reacher.target_position(physics), rng),
            "near_miss": lambda rng: reacher.near_miss(reacher.target_position(physics), rng),
        }
    if task_name in ("drawn_reach", "drawn_home"):

        def move(goal: NDArray[np.float64] | None) -> Action:
            return drawn_reach.move(simulator.dot, simulator.target if goal is None else goal)

        return move, {"wrong_place": lambda rng: drawn_reach.wrong_place(simulator.target, rng)}
    if task_name in meta_world.GOALS:
        return meta_world.script(task_name, simulator), {
            "wrong_place": lambda rng: meta_world.wrong_place(task_name, simulator, rng),
            "near_miss": lambda rng: meta_world.near_miss(task_name, simulator, rng),
        }
    raise BootifolError(f"there is no expert for the task {task_name}; import videos of it instead")


def _simulator(environment: gymnasium.Env[Any, Any]) -> Any:
    return environment.unwrapped.simulator  # type: ignore[attr-defined]


def _action_dim(environment: gymnasium.Env[Any, Any]) -> int:
    assert isinstance(environment.action_space, gymnasium.spaces.Box)
    return environment.action_space.shape[0]
