"""Videos whose looks vary at random, so that a reward cannot tell expert from agent by camera or compression.

Expert videos that come from files differ from the agent's pictures in more than what they show: compression blurs and
smears, cameras have their own brightness, color and noise. A reward that learns to tell the two apart finds these marks
first, and then learns nothing about the task. Each video that it learns from, of either class, is therefore changed as
another camera would. The task is unchanged, and so are the videos that the reward is asked to judge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bootifol.settings import settings
from bootifol.types import FrameBatch, Video, VideoSource

BRIGHTNESS = 12.0
"""Levels of 255 added or taken away, at most; half as many more for each color by itself."""

CONTRAST = 0.1
"""Fraction by which differences grow or shrink, at most; half as much more for each color by itself."""

NOISE = 3.0
"""Greatest standard deviation of the noise of every pixel, in levels of 255."""

BLUR = 0.5
"""Fraction of videos that are blurred, by a binomial filter of 3x3 pixels."""


@dataclass(frozen=True)
@settings("augmentation")
class AugmentationConfig:
    """When looks vary. Every video drawn has its own, and keeps them from its first frame to its last."""

    when: Literal["never", "imported", "always"] = "never"
    """`imported`: where the expert videos come from files. The paper's are recorded and never vary. A pretrained
    backbone, whose features are computed once, never sees them vary, nor do eyes that learn from the expert's alone."""

    def applies(self, imported: bool) -> bool:
        """Whether looks vary in a run whose expert videos were imported, or recorded."""
        return self.when == "always" or (self.when == "imported" and imported)


class AugmentedVideos:
    """A `VideoSource` whose samples vary in looks; a single video, asked for by its place, is as it was.

    Args:
        videos: where samples come from.
    """

    def __init__(self, videos: VideoSource) -> None:
        self.videos = videos

    def __len__(self) -> int:
        return len(self.videos)

    def __getitem__(self, index: int) -> Video:
        return self.videos[index]

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        """As the source's, uint8 `[count, T + 1, H, W, 3]`, each video with looks of its own."""
        return augment(self.videos.sample(count, rng), rng)


def augmented(videos: VideoSource, varied: bool) -> VideoSource:
    """The source with varying looks, where they are `varied`, or itself."""
    return AugmentedVideos(videos) if varied else videos


def augment(videos: FrameBatch, rng: np.random.Generator) -> FrameBatch:
    """Videos `[B, T + 1, H, W, 3]`, uint8, each in other looks; the ones given stay as they are."""
    varied = np.empty_like(videos)
    # Drawing noise takes longer than all else: one draw serves all videos, each from another place of it.
    noise = rng.standard_normal(videos[0].shape, dtype=np.float32)
    for video, out in zip(videos, varied, strict=True):
        pixels = video.astype(np.float32)
        if rng.random() < BLUR:
            pixels = _blurred(pixels)
        # Whole lines of pixels at a time: numpy is slow over an axis of three.
        lines = pixels.reshape(-1, 3 * pixels.shape[2])
        lines *= np.tile(1 + _around_zero(CONTRAST, rng), pixels.shape[2])
        lines += np.tile(_around_zero(BRIGHTNESS, rng), pixels.shape[2])
        moved = np.roll(noise.reshape(-1), int(rng.integers(noise.size))).reshape(noise.shape)
        moved *= np.float32(rng.uniform(0, NOISE))
        pixels += moved
        np.clip(np.rint(pixels, out=pixels), 0, 255, out=pixels)
        out[...] = pixels
    return varied


def _around_zero(most: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """`[3]`: up to `most`, the same for red, green and blue, and up to half of it for each by itself."""
    return (rng.uniform(-most, most) + rng.uniform(-most / 2, most / 2, 3)).astype(np.float32)


def _blurred(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """`[T + 1, H, W, 3]` with (1, 2, 1) / 4 down and across; pictures go on beyond their edges as at the edge."""
    edged = np.pad(pixels, ((0, 0), (1, 1), (1, 1), (0, 0)), mode="edge")
    down = edged[:, 1:-1] * np.float32(2) + edged[:, :-2] + edged[:, 2:]
    blurred: NDArray[np.float32] = down[:, :, 1:-1] * np.float32(2) + down[:, :, :-2] + down[:, :, 2:]
    blurred *= np.float32(1 / 16)
    return blurred
