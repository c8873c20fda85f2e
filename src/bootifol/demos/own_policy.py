"""A policy or script of the user's, which performs in an environment of theirs while it is recorded."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from bootifol.envs.any_gymnasium import GymnasiumSimulator
from bootifol.envs.rollout import Act
from bootifol.errors import BootifolError
from bootifol.plugins import is_own_name, own_callable, told, where
from bootifol.types import Action, Observation


def own_policy(name: str, environment: gymnasium.Env[Any, Any]) -> Act:
    """What `MODULE:FUNCTION` does: called with what the environment itself observes, it returns an action of its own.

    Args:
        name: of a function `act(observation) -> action`; the module may lie in the current directory.
        environment: from `make_environment`, of a Gymnasium task.

    Raises:
        BootifolError: there is no such function, the task is no Gymnasium environment, or (when acting) the function
            fails or returns something else than an action.
    """
    if not is_own_name(name):
        raise BootifolError(f"--policy is MODULE:FUNCTION, such as my_expert:act, not {name}")
    simulator = environment.unwrapped.simulator  # type: ignore[attr-defined]
    if not isinstance(simulator, GymnasiumSimulator):
        raise BootifolError(
            "--policy performs in Gymnasium environments (--task gymnasium:ID or MODULE:FUNCTION): the tasks of the "
            "catalogue have experts of their own"
        )
    function = own_callable(name, "function")

    def act(_: Observation) -> Action:
        try:
            action = np.asarray(function(simulator.observation), np.float64)
        except Exception as error:  # a function may do anything
            raise BootifolError(f"{name} failed: {told(error)}{where(error)}") from error
        if action.shape != simulator.action_shape or not np.isfinite(action).all():
            raise BootifolError(
                f"{name} returned {action.tolist()} where {list(simulator.action_shape)} finite numbers are an action"
            )
        return simulator.in_unit_range(action)

    return act
