"""How an environment is shown: sizes, stacking, render profile."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Annotated, Literal, TypeGuard

import numpy as np
from PIL import Image
from pydantic import Field, Strict

from bootifol.settings import Count, settings
from bootifol.types import Frame, Observation

Pixels = Annotated[int, Strict(), Field(ge=8, le=1024)]
RenderProfile = Literal["fast", "balanced", "full"]


@dataclass(frozen=True)
@settings("pictures")
class PictureConfig:
    """How the agent and the reward model see the environment; one picture an agent step serves both."""

    agent_size: Pixels = 84
    """Height and width of what the agent sees, in pixels."""

    video_size: Pixels = 64
    """Height and width of what the reward model sees, in pixels."""

    stack: Count = 3
    """Newest frames in one observation of the agent."""

    profile: RenderProfile = "fast"
    """fast: no shadows, reflections or sky, about a tenth of the time of full. balanced: a small shadow map, no
    anti-aliasing. full: the simulator's own quality. Videos and environment must agree."""

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
