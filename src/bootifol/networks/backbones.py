"""Frozen pretrained networks that turn every frame of a video into features, once (the paper's Eff-BootIfOL)."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from functools import cache
from typing import Literal, cast

import numpy as np
import torch
from torch import nn

from bootifol.devices import to_device, to_host
from bootifol.errors import BootifolError
from bootifol.networks import efficientnet_lite
from bootifol.networks.transformers_models import Normalization, load_transformers_model
from bootifol.types import Features, Frames, Video

EFFICIENTNET_LITE0 = "efficientnet_lite0"
"""The one backbone that comes in a package; every other name is one of `transformers`."""

FRAMES_AT_ONCE = 16
"""Frames in one pass, which bounds the memory."""


class Backbone:
    """A frozen network: frames in, features out, no gradient and no state that changes.

    Args:
        name: by which it was loaded.
        network: normalized pictures `[N, 3, S, S]` to features `[N, F]`.
        normalization: of pictures in [0, 1].
        video_size: S, the frames' height and width in pixels.
        precision: bf16 computes in bfloat16 where that is safe; features are float32 in either case.
        device: where to compute, as PyTorch names it.

    Raises:
        BootifolError: the network cannot read pictures of that size, or gives other numbers each time.
    """

    def __init__(
        self,
        name: str,
        network: nn.Module,
        normalization: Normalization,
        video_size: int,
        precision: Literal["fp32", "bf16"] = "fp32",
        device: str = "cpu",
    ) -> None:
        self.name = name
        self.video_size = video_size
        self._precision = precision
        self._device = torch.device(device)
        self._mean, self._deviation = (
            torch.tensor(values, device=self._device).view(3, 1, 1) for values in normalization
        )
        self._network = network.to(self._device, memory_format=torch.channels_last).eval()  # type: ignore[call-overload]
        self._network.requires_grad_(False)
        self.fingerprint = _fingerprint(self._network, normalization)
        """Hexadecimal SHA-256 of the weights and the normalization."""
        self.feature_size = self._checked_feature_size()
        """F, the features of a frame."""

    @property
    def key(self) -> str:
        """Names what decides the features: network, weights, size of the pictures, precision."""
        short = re.sub(r"[^A-Za-z0-9._-]+", "-", self.name.rstrip("/").rsplit("/", 1)[-1])
        return f"{short}-{self.video_size}-{self._precision}-{self.fingerprint[:12]}"

    def features(self, frames: Frames) -> Features:
        """Features of every frame, float32 `[N, F]` of uint8 `[N, S, S, 3]`; a frame's do not depend on the others.

        Raises:
            BootifolError: the frames have another size.
        """
        size = self.video_size
        if frames.dtype != np.uint8 or frames.ndim != 4 or frames.shape[1:] != (size, size, 3):
            raise BootifolError(
                f"the backbone reads uint8 frames of {size}x{size} RGB pixels, but was given {frames.dtype} "
                f"{list(frames.shape)}; record or import the videos at that size"
            )
        parts = [
            self._pass(frames[first : first + FRAMES_AT_ONCE])
            for first in range(0, len(frames), FRAMES_AT_ONCE)
        ]
        return np.concatenate(parts)

    def with_features(self, video: Video) -> Video:
        """The video with the features of its frames, which are computed unless it has them."""
        return video if video.features is not None else replace(video, features=self.features(video.frames))

    def _pass(self, frames: Frames) -> Features:
        with (
            torch.inference_mode(),
            torch.autocast(self._device.type, torch.bfloat16, enabled=self._precision == "bf16"),
        ):
            # Channels come last in a frame, as in the layout that convolutions are quickest in.
            pictures = to_device(torch.from_numpy(np.array(frames)), self._device).permute(0, 3, 1, 2)
            normalized = (pictures.float() / 255 - self._mean) / self._deviation
            features = cast(torch.Tensor, self._network(normalized))
            return to_host(features.float())

    def _checked_feature_size(self) -> int:
        """F, found by trying; refuses what cannot serve as a backbone."""
        size = self.video_size
        frames = np.random.default_rng(0).integers(0, 256, (2, size, size, 3), dtype=np.uint8)
        try:
            once, again = self._pass(frames), self._pass(frames)
        # A network may fail on a size in any way.
        except Exception as error:
            raise BootifolError(
                f"the backbone {self.name} cannot read pictures of {size}x{size} pixels ({error}); most read 224: "
                "record or import the videos so, and add --pictures.video-size 224"
            ) from error
        if once.ndim != 2 or len(once) != 2 or not np.isfinite(once).all() or not np.array_equal(once, again):
            raise BootifolError(
                f"the backbone {self.name} does not turn a picture into one vector, always the same (it hides parts "
                "of pictures at random, or lacks weights); choose another, such as google/efficientnet-b0"
            )
        return int(once.shape[1])


@cache
def load_backbone(
    name: str, video_size: int, precision: Literal["fp32", "bf16"] = "fp32", device: str = "cpu"
) -> Backbone:
    """A pretrained backbone by name; being frozen, it is loaded once for all who ask.

    Args:
        name: efficientnet_lite0, or a vision model of the Hugging Face hub, or a directory with one.
        video_size: height and width of the frames in pixels.
        precision: fp32 or bf16.
        device: where to compute, as PyTorch names it.

    Raises:
        BootifolError: the weights or a library are missing, or the network cannot serve as a backbone.
    """
    if name == EFFICIENTNET_LITE0:
        network: nn.Module = efficientnet_lite.load_efficientnet_lite0()
        normalized = Normalization(efficientnet_lite.MEAN, efficientnet_lite.STANDARD_DEVIATION)
    else:
        network, normalized = load_transformers_model(name)
    return Backbone(name, network, normalized, video_size, precision, device)


def _fingerprint(network: nn.Module, normalization: Normalization) -> str:
    digest = hashlib.sha256(repr(normalization).encode())
    for name, value in network.state_dict().items():
        digest.update(name.encode())
        digest.update(to_host(value.contiguous().view(-1).view(torch.uint8)).data)
    return digest.hexdigest()
