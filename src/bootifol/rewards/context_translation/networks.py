"""The networks of context translation (appendix of its paper): two encoders, a translator and a decoder."""

from __future__ import annotations

from itertools import pairwise
from typing import cast

import torch
import torch.nn.functional as F
from torch import nn

from bootifol.errors import BootifolError
from bootifol.rewards.context_translation.config import ContextTranslationConfig

WIDTHS = (64, 128, 256, 512)
"""Channels of the 5x5 stride-2 layers in the paper."""

FEATURES = 1024
"""Size of every fully connected layer in the paper, so of a frame's features."""

HALVINGS = 2 ** len(WIDTHS)
"""What the strided layers divide the side of a picture by."""

LEAK = 0.2
"""Slope of LeakyReLU below zero."""

Skips = list[torch.Tensor]
"""What the context encoder's strided layers gave, large pictures first; the decoder reads them again."""


class Encoder(nn.Module):
    """Enc1 or Enc2: four 5x5 stride-2 convolutions, each halving the picture, and two fully connected layers.

    Args:
        config: widths.
        video_size: side of the pictures, a multiple of 16.
        activated: whether the features pass LeakyReLU (Enc1, as in the authors' release) or not (Enc2).
    """

    def __init__(self, config: ContextTranslationConfig, video_size: int, activated: bool) -> None:
        super().__init__()
        widths = [3, *(width // config.width_divisor for width in WIDTHS)]
        features = FEATURES // config.width_divisor
        self.activated = activated
        self.strided = nn.ModuleList(nn.Conv2d(*between, 5, 2, 2) for between in pairwise(widths))
        self.hidden = nn.Linear(widths[-1] * (video_size // HALVINGS) ** 2, features)
        self.output = nn.Linear(features, features)

    def forward(self, pictures: torch.Tensor) -> tuple[torch.Tensor, Skips]:
        """Pictures `[N, 3, H, W]` in [-1, 1] to features `[N, D]` and the four layers before them."""
        skips: Skips = []
        for layer in self.strided:
            pictures = F.leaky_relu(layer(pictures), LEAK)
            skips.append(pictures)
        features = self.output(F.leaky_relu(self.hidden(pictures.flatten(1)), LEAK))
        return F.leaky_relu(features, LEAK) if self.activated else features, skips


class Translator(nn.Module):
    """T: features of a frame and of a context to the features of that frame in that context, one hidden layer."""

    def __init__(self, config: ContextTranslationConfig) -> None:
        super().__init__()
        features = FEATURES // config.width_divisor
        self.layers = nn.Sequential(
            nn.Linear(2 * features, features), nn.LeakyReLU(LEAK), nn.Linear(features, features)
        )

    def forward(self, features: torch.Tensor, context: torch.Tensor) -> torch.Tensor:
        """`[N, D]` and `[N, D]` to `[N, D]`."""
        return cast(torch.Tensor, self.layers(torch.cat([features, context], 1)))


class Decoder(nn.Module):
    """Dec: a fully connected layer, then four 5x5 transposed convolutions, each doubling the picture.

    Each reads, beside the layer before it, the context encoder's layer of the same size: what stands still is copied
    from the context, what moves is drawn from the features.
    """

    def __init__(self, config: ContextTranslationConfig, video_size: int) -> None:
        super().__init__()
        widths = [*(width // config.width_divisor for width in WIDTHS[::-1]), 3]
        self.smallest = (widths[0], video_size // HALVINGS, video_size // HALVINGS)
        self.hidden = nn.Linear(FEATURES // config.width_divisor, widths[0] * self.smallest[1] ** 2)
        self.strided = nn.ModuleList(
            nn.ConvTranspose2d(2 * before, after, 5, 2, 2, output_padding=1)
            for before, after in pairwise(widths)
        )

    def forward(self, features: torch.Tensor, skips: Skips) -> torch.Tensor:
        """Features `[N, D]` and the context's layers to pictures `[N, 3, H, W]`."""
        pictures = self.hidden(features).unflatten(1, self.smallest)
        for layer, skip in zip(self.strided, reversed(skips), strict=True):
            pictures = layer(torch.cat([F.leaky_relu(pictures, LEAK), skip], 1))
        return cast(torch.Tensor, pictures)


class ContextTranslationNetworks(nn.Module):
    """Enc1, Enc2, T and Dec.

    Raises:
        BootifolError: the pictures cannot be halved four times.
    """

    def __init__(self, config: ContextTranslationConfig, video_size: int) -> None:
        super().__init__()
        if video_size < HALVINGS or video_size % HALVINGS:
            raise BootifolError(
                f"context translation cannot read {video_size}x{video_size} videos: its four layers halve the picture, "
                f"so the side must be a multiple of {HALVINGS}; use videos of 64x64 or 32x32"
            )
        self.frame_encoder = Encoder(config, video_size, activated=True)
        self.context_encoder = Encoder(config, video_size, activated=False)
        self.translator = Translator(config)
        self.decoder = Decoder(config, video_size)
