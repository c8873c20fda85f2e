"""How an environment is shown: sizes, stacking, render profile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from PIL import Image

from bootifol.errors import BootifolError
from bootifol.types import Frame

RenderProfile = Literal["fast", "balanced", "full"]


@dataclass(frozen=True)
class PictureConfig:
    """How the agent and the reward model see the environment; one picture an agent step serves both."""

    agent_size: int = 84
    """Height and width of what the agent sees, in pixels."""

    video_size: int = 64
    """Height and width of what the reward model sees, in pixels."""

    stack: int = 3
    """Newest frames in one observation of the agent."""

    profile: RenderProfile = "fast"
    """fast: no shadows, reflections or sky, about a tenth of the time of full. balanced: a small shadow map, no
    anti-aliasing. full: the simulator's own quality. Videos and environment must agree."""

    def __post_init__(self) -> None:
        for name in ("agent_size", "video_size"):
            if not 8 <= getattr(self, name) <= 1024:
                raise BootifolError(
                    f"pictures: {name} must lie in 8 … 1024 pixels, not {getattr(self, name)}"
                )
        if self.stack < 1:
            raise BootifolError(f"pictures: stack must be at least 1 frame, not {self.stack}")
        if self.profile not in ("fast", "balanced", "full"):
            raise BootifolError(f"pictures: profile must be fast, balanced or full, not '{self.profile}'")

    @property
    def picture_size(self) -> int:
        """Height and width of the one picture that is rendered, in pixels."""
        return max(self.agent_size, self.video_size)


def centered_square(picture: Frame, size: int) -> Frame:
    """The largest centered square of a picture `[H, W, 3]`, resized to `[size, size, 3]`.

    Imported videos and rendered pictures both pass through here, so that they show the same part of a scene.
    """
    height, width, _ = picture.shape
    side = min(height, width)
    top, left = (height - side) // 2, (width - side) // 2
    return resize(picture[top : top + side, left : left + side], size)


def resize(picture: Frame, size: int) -> Frame:
    """A picture `[H, W, 3]` at `[size, size, 3]`, each pixel the mean of the area it covers."""
    if picture.shape[:2] == (size, size):
        return picture
    return np.asarray(Image.fromarray(picture).resize((size, size), Image.Resampling.BOX))
