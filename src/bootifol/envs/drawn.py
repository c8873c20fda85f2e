"""A small task drawn with numpy alone: a dot that must reach a ring. For tests, and for a first try without MuJoCo."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bootifol.envs.pictures import PictureConfig
from bootifol.types import Action, Frame

SPEED = 0.06
"""Farthest move of a step along each axis; the field is [-1, 1] x [-1, 1]."""
TARGET_RADIUS = 0.2
DOT_RADIUS = 0.14
BACKGROUND, TARGET_COLOR, DOT_COLOR = (28, 34, 48), (214, 90, 70), (240, 226, 150)


class DrawnReach:
    """The true reward is 1 while the dot's center is within the target's radius and 0 elsewhere.

    Args:
        pictures: size of the picture; the render profile makes no difference.
    """

    action_dim = 2

    def __init__(self, pictures: PictureConfig) -> None:
        size = pictures.picture_size
        centers = (np.arange(size) + 0.5) * (2.0 / size) - 1.0
        self._x, self._y = np.meshgrid(centers, -centers)
        self._softness = 2.0 / size
        self.dot = np.zeros(2)
        self.target = np.zeros(2)

    def reset(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.target = rng.uniform(-0.75, 0.75, 2)
        self.dot = rng.uniform(-0.9, 0.9, 2)
        while np.hypot(*(self.dot - self.target)) < 0.5:
            self.dot = rng.uniform(-0.9, 0.9, 2)

    def step(self, action: Action) -> tuple[float, bool, bool | None]:
        self.dot = np.clip(self.dot + SPEED * np.asarray(action, np.float64), -0.95, 0.95)
        reached = bool(np.hypot(*(self.dot - self.target)) < TARGET_RADIUS)
        return float(reached), False, reached

    def render(self) -> Frame:
        picture = np.empty((*self._x.shape, 3), np.float64)
        picture[:] = BACKGROUND
        self._paint(picture, self.target, TARGET_RADIUS, TARGET_COLOR)
        self._paint(picture, self.dot, DOT_RADIUS, DOT_COLOR)
        return picture.astype(np.uint8)

    def close(self) -> None:
        """Nothing to free."""

    def _paint(
        self, picture: NDArray[np.float64], center: NDArray[np.float64], radius: float, color: Any
    ) -> None:
        """An anti-aliased disc."""
        distance = np.hypot(self._x - center[0], self._y - center[1])
        cover = np.clip((radius - distance) / self._softness + 0.5, 0.0, 1.0)[..., None]
        picture += cover * (np.asarray(color, np.float64) - picture)
