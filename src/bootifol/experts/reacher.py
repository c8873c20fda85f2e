"""A scripted expert for DeepMind Control's reacher: two-link inverse kinematics and a damped spring."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bootifol.types import Action

LINK = 0.12
"""Length of each of the arm's two links, in meters."""

STIFFNESS, DAMPING = 4.0, 0.15
"""Torque (in units of its limit) per radian of error, and per radian a second. An action holds for two simulator
steps, and with more damping that delay alone keeps the arm trembling: at 0.2 when folded, at 0.3 in any pose, by
2 radians a second."""


def torques(physics: Any, goal: NDArray[np.float64]) -> Action:
    """The action `[2]` that brings the fingertip to `goal` `[2]`, a point in meters."""
    angles = physics.data.qpos[:2]
    velocities = physics.data.qvel[:2]
    error = _nearest_angles(goal, angles) - angles
    error[0] = _wrapped(error[0])
    action: Action = np.clip(STIFFNESS * error - DAMPING * velocities, -1.0, 1.0).astype(np.float32)
    return action


def target_position(physics: Any) -> NDArray[np.float64]:
    """Where the target lies, `[2]` in meters."""
    position: NDArray[np.float64] = physics.named.data.geom_xpos["target", :2].copy()
    return position


def wrong_place(target: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A goal `[2]` on the other side of the center, in meters.

    The suite draws targets 0.05 to 0.20 m from the center. At 135 to 180 degrees from them, and 0.08 to 0.20 m from
    the center, this is 0.12 m or more away; the reward ends 0.025 m from the target.
    """
    angle = np.arctan2(-target[1], -target[0]) + rng.uniform(-np.pi / 4, np.pi / 4)
    place: NDArray[np.float64] = rng.uniform(0.08, 0.2) * np.array([np.cos(angle), np.sin(angle)])
    return place


def near_miss(target: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A goal `[2]` beside the target, 0.04 to 0.06 m from it and within reach; the reward ends at 0.025 m."""
    while True:
        angle = rng.uniform(-np.pi, np.pi)
        place: NDArray[np.float64] = target + rng.uniform(0.04, 0.06) * np.array(
            [np.cos(angle), np.sin(angle)]
        )
        if 0.03 < np.hypot(*place) < 2 * LINK - 0.01:
            return place


def _nearest_angles(goal: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The joint angles that reach `goal`: of the two elbow bends, the one closer to where the arm is."""
    distance = min(float(np.hypot(*goal)), 2 * LINK - 1e-4)
    bend = float(np.arccos(np.clip(distance**2 / (2 * LINK**2) - 1.0, -1.0, 1.0)))
    solutions = [
        np.array([np.arctan2(goal[1], goal[0]) - elbow / 2, elbow], dtype=np.float64)
        for elbow in (bend, -bend)
    ]
    return min(solutions, key=lambda s: abs(_wrapped(s[0] - angles[0])) + abs(s[1] - angles[1]))


def _wrapped(angle: float) -> float:
    """The same angle in [-π, π)."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
