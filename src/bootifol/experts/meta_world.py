"""Scripted experts for Meta-World: the policies that come with it."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bootifol.envs.meta_world import load_meta_world
from bootifol.experts.behaviors import Controller
from bootifol.types import Action

GOALS = {"button_press": slice(4, 7), "plate_slide": slice(36, 39), "drawer_close": slice(4, 7)}
"""By task, the part of the observation that says where its script must go: the button, the goal of the plate, the
drawer's handle."""


def script(task_name: str, simulator: Any) -> Controller:
    """The task's policy, as a controller of a `MetaWorldSimulator`; its goals are `[3]`, in meters.

    Toward another goal it does what it would if the button, the goal or the handle were there.
    """
    policy = load_meta_world("policies").ENV_POLICY_MAP[simulator.name]()

    def act(goal: NDArray[np.float64] | None) -> Action:
        observation = simulator.observation.copy()
        if goal is not None:
            observation[GOALS[task_name]] = goal
        with warnings.catch_warnings():
            # That actions leave [-1, 1] and are clipped, which is meant.
            warnings.simplefilter("ignore")
            action: Action = np.clip(policy.get_action(observation), -1.0, 1.0).astype(np.float32)
        return action

    return act


def wrong_place(task_name: str, simulator: Any, rng: np.random.Generator) -> NDArray[np.float64]:
    """A goal `[3]`, 0.2 to 0.3 m to the left or the right of the true one, in meters: the hand still gets there."""
    place: NDArray[np.float64] = simulator.observation[GOALS[task_name]].copy()
    place[0] += rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.3)
    return place


def near_miss(task_name: str, simulator: Any, rng: np.random.Generator) -> NDArray[np.float64]:
    """A goal `[3]`, 0.07 to 0.09 m to the left or the right of the true one, in meters."""
    place: NDArray[np.float64] = simulator.observation[GOALS[task_name]].copy()
    place[0] += rng.choice([-1.0, 1.0]) * rng.uniform(0.07, 0.09)
    return place
