"""Who fails plausibly: performers whose motion is smooth or skilled, and who do not do the task.

A reward that only tells an expert's smoothness from noise ranks these as high as the expert.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from bootifol.envs.rollout import Act
from bootifol.experts import BUNDLED, script_of
from bootifol.experts.behaviors import Controller, WrongGoal
from bootifol.experts.policy import StatePolicy
from bootifol.types import Action, Observation

KINDS = (
    "near_miss",
    "wrong_place",
    "stopped_short",
    "late",
    "weak",
    "half_random",
    "half_trained",
    "held_actions",
    "random",
    "still",
)
"""From the most plausible down.

near_miss: the expert's reach to a place beside the goal, too far from it to count. wrong_place: its reach to another
place altogether. Both where the task has a place to go. stopped_short: the expert for a fifth of the episode, then
nothing. late: nothing for three fifths, then the expert. weak: the expert's actions at a fifth of their strength.
half_random: every other action is random. half_trained: an earlier policy of the expert's training, where one is
bundled. held_actions: random actions, each held for ten steps. random, still: as recorded.
"""


def failures_of(task_name: str, environment: gymnasium.Env[Any, Any]) -> list[str]:
    """Those of `KINDS` that can play a task.

    Raises:
        BootifolError: the task has no expert to fail like.
    """
    _, wrong_goals = script_of(task_name, environment)
    half_trained = BUNDLED / f"{task_name}.half_trained.safetensors"
    missing = {
        **{kind: kind not in wrong_goals for kind in ("near_miss", "wrong_place")},
        "half_trained": not half_trained.exists(),
    }
    return [kind for kind in KINDS if not missing.get(kind, False)]


def make_failure(kind: str, task_name: str, environment: gymnasium.Env[Any, Any], seed: int) -> Act:
    """Whoever fails so; make one for every episode.

    Args:
        kind: of `failures_of` the task.
        task_name: from the catalogue.
        environment: what it acts in.
        seed: of everything random about it.
    """
    controller, wrong_goals = script_of(task_name, environment)
    if kind == "half_trained":
        policy = StatePolicy.load(BUNDLED / f"{task_name}.half_trained.safetensors")
        simulator = environment.unwrapped.simulator  # type: ignore[attr-defined]
        controller = lambda goal: policy(simulator.state())  # noqa: E731
    rng = np.random.default_rng([seed, 5])
    return _Failure(kind, controller, environment, rng, wrong_goals.get(kind))


class _Failure:
    """One episode of a failure."""

    def __init__(
        self,
        kind: str,
        controller: Controller,
        environment: gymnasium.Env[Any, Any],
        rng: np.random.Generator,
        wrong_goal: WrongGoal | None,
    ) -> None:
        self._kind, self._controller, self._rng, self._wrong_goal = kind, controller, rng, wrong_goal
        self._steps: int = environment.unwrapped.episode_steps  # type: ignore[attr-defined]
        self._size: int = environment.action_space.shape[0]  # type: ignore[index]
        self._goal: NDArray[np.float64] | None = None
        self._held: Action = np.zeros(self._size, np.float32)
        self._step = 0

    def __call__(self, observation: Observation) -> Action:
        """One action; the observation is not needed."""
        step, kind = self._step, self._kind
        self._step += 1
        if step == 0 and self._wrong_goal is not None:
            # Only now does the simulator show this episode's start.
            self._goal = self._wrong_goal(self._rng)
        nothing: Action = np.zeros(self._size, np.float32)
        if kind == "still" or (kind == "stopped_short" and step >= self._steps // 5):
            return nothing
        if kind == "late" and step < 3 * self._steps // 5:
            return nothing
        if kind == "random" or (kind == "half_random" and step % 2):
            return self._random()
        if kind == "held_actions":
            if step % 10 == 0:
                self._held = self._random()
            return self._held
        action = self._controller(self._goal)
        weak: Action = action * np.float32(0.2)
        return weak if kind == "weak" else action

    def _random(self) -> Action:
        return self._rng.uniform(-1.0, 1.0, self._size).astype(np.float32)
