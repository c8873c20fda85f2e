"""A scripted expert for the drawn task: straight to the goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bootifol.envs.drawn import SPEED
from bootifol.types import Action


def move(dot: NDArray[np.float64], goal: NDArray[np.float64]) -> Action:
    """The action `[2]` that brings the dot to `goal`, both `[2]` in units of the field, as fast as it can move."""
    action: Action = np.clip((goal - dot) / SPEED, -1.0, 1.0).astype(np.float32)
    return action


def wrong_place(target: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A goal `[2]` that is at least 0.6 away from the target, where the reward has nearly fallen to 0."""
    place = rng.uniform(-0.9, 0.9, 2)
    while np.hypot(*(place - target)) < 0.6:
        place = rng.uniform(-0.9, 0.9, 2)
    return place
