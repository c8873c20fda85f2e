"""A small task drawn with numpy alone: a dot that must reach a disc. For tests, and for a first try without MuJoCo."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bootifol.envs.pictures import PictureConfig
from bootifol.types import Action, Frame

SPEED = 0.06
"""Farthest move of a step along each axis; the field is [-1, 1] x [-1, 1]."""
TARGET_RADIUS = 0.2
DOT_RADIUS = 0.14
REWARD_MARGIN = 0.5
"""How far outside the target's radius the reward falls to 0."""
BACKGROUND, TARGET_COLOR, DOT_COLOR = (
    np.array(color, np.float32) for color in ((28, 34, 48), (214, 90, 70), (240, 226, 150))
)


class DrawnReach:
    """The true reward is 1 while the dot's center is within the target's radius, and falls linearly to 0 outside.

    Args:
        pictures: size of the picture; the render profile makes no difference.
        fixed_target: center of the target in every episode; None draws one for each.
    """

    action_dim = 2
    step_seconds = 0.1

    def __init__(self, pictures: PictureConfig, fixed_target: tuple[float, float] | None = None) -> None:
        self._fixed_target = fixed_target
        self._size = pictures.picture_size
        self._background = np.full((self._size, self._size, 3), BACKGROUND, np.uint8)
        self._pixels = np.arange(self._size) + 0.5
        self.dot = np.zeros(2)
        """Center of the dot, x to the right and y upward."""
        self.target = np.zeros(2)
        """Center of the target."""

    def reset(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        drawn = rng.uniform(-0.75, 0.75, 2)
        self.target = drawn if self._fixed_target is None else np.array(self._fixed_target)
        self.dot = rng.uniform(-0.9, 0.9, 2)
        while self._distance() < 0.5:
            self.dot = rng.uniform(-0.9, 0.9, 2)

    def step(self, action: Action) -> tuple[float, bool, bool | None]:
        self.dot = (self.dot + SPEED * np.asarray(action, np.float64)).clip(-0.95, 0.95)
        outside = self._distance() - TARGET_RADIUS
        return min(max(1.0 - outside / REWARD_MARGIN, 0.0), 1.0), False, outside <= 0.0

    def render(self) -> Frame:
        picture = self._background.copy()
        self._paint(picture, self.target, TARGET_RADIUS, TARGET_COLOR)
        self._paint(picture, self.dot, DOT_RADIUS, DOT_COLOR)
        return picture

    def close(self) -> None:
        """Nothing to free."""

    def _distance(self) -> float:
        return math.dist(self.dot, self.target)

    def _paint(
        self, picture: Frame, center: NDArray[np.float64], radius: float, color: NDArray[np.float32]
    ) -> None:
        """An anti-aliased disc; only the pixels around it are touched."""
        per_unit = self._size / 2.0
        column, row = float(center[0] + 1.0) * per_unit, float(1.0 - center[1]) * per_unit
        reach = radius * per_unit + 1.0
        columns = slice(max(int(column - reach), 0), int(column + reach) + 1)
        rows = slice(max(int(row - reach), 0), int(row + reach) + 1)
        squared = (self._pixels[rows, None] - row) ** 2 + (self._pixels[columns] - column) ** 2
        cover = (radius * per_unit + 0.5 - np.sqrt(squared, dtype=np.float32)).clip(0.0, 1.0)[..., None]
        part = picture[rows, columns]
        part[:] = part + cover * (color - part)
