"""What flows through the library, with its shapes.

Letters used in every shape comment:

- `T`: agent steps of an episode, so an episode has `T + 1` frames.
- `H, W`: height and width of a frame in pixels.
- `A`: number of action dimensions.
- `B`: batch size.  `C`: channels.  `Z`: size of an embedding (128 in the paper).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # whoever lists tasks or records videos does not wait for PyTorch
    import torch

AnyPath = str | os.PathLike[str]
"""A path however it is written."""

Frame = NDArray[np.uint8]
"""One RGB picture, uint8 `[H, W, 3]`."""

Frames = NDArray[np.uint8]
"""The pictures of one episode, uint8 `[T + 1, H, W, 3]`; frame 0 precedes the first action."""

FrameBatch = NDArray[np.uint8]
"""Videos of one length, uint8 `[B, T + 1, H, W, 3]`."""

Features = NDArray[np.float32]
"""What a frozen pretrained network made of the pictures of one episode, float32 `[T + 1, F]`."""

FrameStates = NDArray[np.int8]
"""What eyes that rest made of the pictures of one episode, int8 `[T + 1, Z]` (`networks/eyes.py`)."""

FeatureBatch = NDArray[np.float32] | NDArray[np.int8]
"""Features or states of videos of one length, `[B, T + 1, F]`."""

Observation = NDArray[np.uint8]
"""What the agent sees: the newest frames stacked along channels, oldest first, uint8 `[H, W, 3 * stack]`."""

Action = NDArray[np.float32]
"""Float32 `[A]` in [-1, 1]; environments rescale it to their own range."""

Rewards = NDArray[np.float32]
"""Float32 `[T]`; entry `t` rewards action `t`, after which frame `t + 1` was seen."""

Metrics = Mapping[str, float]
"""Named numbers to log, such as `{"loss/sequence": 0.41}`."""

StepMetrics: TypeAlias = "Mapping[str, float | torch.Tensor]"
"""Metrics of one step, of which some may still be scalars on their device, to be fetched when they are logged."""

Arrays = dict[str, NDArray[np.generic]]
"""The state of a component as named arrays, ready for a safetensors file."""


@dataclass(frozen=True)
class Video:
    """A recording: pictures and a name, nothing else."""

    name: str
    """Unique among the videos of one run; caches of encodings use it as their key."""

    frames: Frames
    """uint8 `[T + 1, H, W, 3]` at the size the reward model reads; of 0x0 pixels where features alone are kept."""

    environment_rewards: Rewards | None = None
    """The true rewards `[T]`. None, except on the agent's own episodes under the method named
    `environment` (the upper bound), which is the only one that may read them."""

    features: Features | FrameStates | None = None
    """Of the frames, where a frozen backbone or eyes that rest have computed them already."""


@dataclass(frozen=True)
class Episode:
    """One episode of the agent, as learners may see it: no reward of the environment."""

    frames: Frames
    """uint8 `[T + 1, S, S, 3]` at the size the agent reads."""

    actions: NDArray[np.float32]
    """`[T, A]`; action `t` was taken after frame `t`."""

    video: Video
    """The same episode at the size the reward model reads."""

    terminated: bool
    """True when the environment ended by itself (no bootstrapping from the last frame);
    False when the time limit cut it."""

    @property
    def agent_steps(self) -> int:
        return len(self.actions)

    @property
    def largest_frames(self) -> Frames:
        """At the larger of both sizes, for people to look at."""
        return max(self.frames, self.video.frames, key=lambda frames: frames.shape[1])


@dataclass(frozen=True)
class Batch:
    """`B` n-step transitions sampled from replay."""

    observation: torch.Tensor
    """uint8 `[B, 3 * stack, S, S]`, channels-last in memory, randomly shifted; or, where replay keeps the states of
    frames, int8 `[B, stack * Z]`."""

    action: torch.Tensor
    """float32 `[B, A]`."""

    reward: torch.Tensor
    """float32 `[B]`: the sum of `discount ** k * r_{t+k}` for k below the steps taken (n, or fewer at the end)."""

    discount: torch.Tensor
    """float32 `[B]`: the weight of the value of `next_observation`; 0 after a termination."""

    next_observation: torch.Tensor
    """As `observation`."""

    demonstrated: torch.Tensor | None = None
    """bool `[B]`: which rows come from expert videos with inferred actions; None when none do (the paper)."""


class VideoSource(Protocol):
    """Videos to draw from: a demo set on disk, or the agent's own episodes."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Video: ...

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        """`count` videos drawn uniformly, without repetition where there are enough."""
        ...


@dataclass(frozen=True)
class OtherCamera:
    """Videos, as a `VideoSource`, that look otherwise than the expert's whatever they show: those come from files, and
    are told from these by their compression."""

    videos: VideoSource

    def __len__(self) -> int:
        return len(self.videos)

    def __getitem__(self, index: int) -> Video:
        return self.videos[index]

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        """As the source's."""
        return self.videos.sample(count, rng)


@runtime_checkable
class FeatureSource(VideoSource, Protocol):
    """Videos to draw from whose features were computed once."""

    def sample_features(self, count: int, rng: np.random.Generator) -> FeatureBatch:
        """The features of the videos that `sample` would give."""
        ...
