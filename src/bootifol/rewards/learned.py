"""What the reward models that learn have in common: networks, optimizer, random draws, kept encodings, and state."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.modules.batchnorm import _BatchNorm

from bootifol.devices import to_device
from bootifol.optim import GradientStep, generator_array, load_generator, load_module_state, module_state
from bootifol.rewards.video_checks import checked_videos
from bootifol.types import Arrays, FrameBatch, Frames, Video, VideoSource


class LearnedConfig(Protocol):
    """What the configuration of every method that learns has."""

    @property
    def learning_rate(self) -> float:
        """Of Adam."""
        ...


NORMALIZATION_MOMENTUM = 0.1
"""How far running normalization statistics move to those of a gradient step, PyTorch's default."""

Config = TypeVar("Config", bound=LearnedConfig)
Networks = TypeVar("Networks", bound=nn.Module)
Encoding = TypeVar("Encoding")


class LearnedRewardModel(Generic[Config, Networks]):
    """The base of the methods' reward models, which add `align`, `update` and `label`.

    Args:
        make_networks: the method's networks, from its configuration and the side of the videos.
        config: the method's.
        video_size: side of the (square) videos in pixels.
        seed: of the parameters and of every draw.
        device: where to compute, as PyTorch names it.
    """

    reads_environment_reward = False

    def __init__(
        self,
        make_networks: Callable[[Config, int], Networks],
        config: Config,
        video_size: int,
        seed: int,
        device: str,
    ) -> None:
        self.config = config
        self.video_size = video_size
        self.device = torch.device(device)
        self._kept_encodings: dict[str, Any] = {}
        self.version = 0
        # PyTorch initializes layers from its global generator, so it is seeded here and given back as it was.
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.networks = make_networks(config, video_size)
        self.networks.to(self.device)
        self._normalizations = [layer for layer in self.networks.modules() if isinstance(layer, _BatchNorm)]
        self._optimizer = torch.optim.Adam(self.networks.parameters(), lr=config.learning_rate, fused=True)
        self._rng = np.random.default_rng(seed)

    @property
    def version(self) -> int:
        """Counts gradient steps. Whatever sets it, a step or `load_state`, forgets the encodings kept so far."""
        return self._version

    @version.setter
    def version(self, version: int) -> None:
        self._version = version
        self._kept_encodings.clear()

    def state(self) -> Arrays:
        """Parameters, normalization statistics, Adam, random state and version."""
        return {
            **module_state(self.networks, {"adam": self._optimizer}, "network/"),
            "random": generator_array(self._rng),
            "version": np.array([self.version], dtype=np.int64),
        }

    def load_state(self, arrays: Arrays) -> None:
        """Takes over what `state` gave; goes on bit for bit as that model would.

        Raises:
            BootifolError: an array is missing or has another shape (the run had another configuration).
        """
        load_module_state(self.networks, {"adam": self._optimizer}, arrays, "reward model", "network/")
        load_generator(self._rng, arrays["random"])
        self.version = int(arrays["version"][0])

    def _sample(self, source: VideoSource, count: int) -> FrameBatch:
        """Videos drawn at random, uint8 `[count, T + 1, H, W, 3]` of the model's size."""
        return checked_videos(source.sample(count, self._rng), self.video_size)

    def _checked(self, frames: Frames) -> Frames:
        """One video, uint8 `[T + 1, H, W, 3]` of the model's size."""
        video: Frames = checked_videos(frames[None], self.video_size)[0]
        return video

    def _encoded_once(
        self, references: Sequence[Video], encode: Callable[[Video], Encoding]
    ) -> list[Encoding]:
        """What `encode` makes of each reference, kept by the reference's name until `version` is set."""
        kept = self._kept_encodings
        for reference in references:
            if reference.name not in kept:
                kept[reference.name] = encode(reference)
        return [kept[reference.name] for reference in references]

    def _on_device(self, array: NDArray[np.generic]) -> torch.Tensor:
        """An array of the host as a tensor where the networks compute."""
        return to_device(torch.from_numpy(array), self.device)

    def _begin_step(self) -> GradientStep:
        """The gradient step after those that `version` counts; to be made before the forward pass.

        Running statistics are the mean over the first ten steps, and only then an exponential one. From their initial
        0 and 1 they would take dozens of steps to what the layers see; until then rewards would be of networks that
        nobody trained, which matters to methods that learn only while the agent acts.
        """
        for layer in self._normalizations:
            layer.momentum = max(NORMALIZATION_MOMENTUM, 1.0 / (self.version + 1))
        return GradientStep(self.networks, self._optimizer, self.version + 1)

    @contextmanager
    def _evaluating(self) -> Iterator[None]:
        """Without gradients, and with the running normalization statistics: a frame is encoded by itself alone."""
        self.networks.eval()
        try:
            with torch.inference_mode():
                yield
        finally:
            self.networks.train()

    def _autocast(self) -> torch.autocast:
        """bfloat16 where a method's configuration says so."""
        bf16 = getattr(self.config, "precision", "fp32") == "bf16"
        return torch.autocast(self.device.type, torch.bfloat16, enabled=bf16)
