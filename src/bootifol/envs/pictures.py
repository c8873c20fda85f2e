"""How an environment is shown: sizes, stacking, render profile."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Literal, TypeGuard

import numpy as np
from PIL import Image

from bootifol.errors import BootifolError
from bootifol.types import Frame, Observation

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


def is_picture(value: object) -> TypeGuard[Frame]:
    """Whether a value is an RGB picture, uint8 `[H, W, 3]`, of at least one pixel."""
    return (
        isinstance(value, np.ndarray)
        and value.dtype == np.uint8
        and value.ndim == 3
        and value.shape[2] == 3
        and value.size > 0
    )


def told_kind(value: object) -> str:
    """Type and shape of what is no picture, for an error's sentence."""
    return f"{value.dtype} {list(value.shape)}" if isinstance(value, np.ndarray) else type(value).__name__


class FrameStack:
    """The newest frames of an episode along channels, oldest first; an episode's first frame is repeated.

    Args:
        stack: frames in an observation.
    """

    def __init__(self, stack: int) -> None:
        self._frames: deque[Frame] = deque(maxlen=stack)
        self._stack = stack

    def start(self) -> None:
        """The next frame is the first of an episode."""
        self._frames.clear()

    def add(self, frame: Frame) -> Observation:
        """What the agent sees, uint8 `[S, S, 3 * stack]`, after one more frame.

        Args:
            frame: uint8 `[S, S, 3]`, contiguous; kept, not copied.
        """
        self._frames.extend([frame] if self._frames else [frame] * self._stack)
        # Whole pixels are moved instead of single bytes, in half the time.
        pixels = np.concatenate([frame.view("V3") for frame in self._frames], axis=2)
        return pixels.view(np.uint8)


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
