"""GAIfO's discriminator network."""

from __future__ import annotations

from itertools import pairwise
from typing import cast

import torch
from torch import nn

from bootifol.networks.frame_encoders import strided_layers
from bootifol.rewards.gaifo.config import GaifoConfig

LEAK = 0.01
"""Slope of LeakyReLU below zero."""

STACK = 3
"""Successive frames that the discriminator sees at once."""

POINTWISE_WIDTHS = (512, 128, 32)
"""Channels of the 1x1 layers before the logit, as in the public image version; they cost too little to divide."""


class Discriminator(nn.Module):
    """From a stack of frames to the logit of "the expert made it".

    Strided 5x5 convolutions down to one pixel, then 1x1 convolutions, which see one pixel and so are linear layers.
    Every layer but the last is followed by BatchNorm and LeakyReLU and has no bias of its own.

    Args:
        config: see there.
        video_size: the pictures' side in pixels.
    """

    def __init__(self, config: GaifoConfig, video_size: int) -> None:
        super().__init__()
        self.strided, width = strided_layers(3 * STACK, video_size, config.width_divisor, LEAK)
        self.pointwise = nn.Sequential()
        for before, after in pairwise([width, *POINTWISE_WIDTHS]):
            self.pointwise.append(nn.Linear(before, after, bias=False))
            self.pointwise.append(nn.BatchNorm1d(after))
            self.pointwise.append(nn.LeakyReLU(LEAK))
        self.pointwise.append(nn.Linear(POINTWISE_WIDTHS[-1], 1))

    def forward(self, stacks: torch.Tensor) -> torch.Tensor:
        """Stacks `[N, 3 * stack, H, W]` in [0, 1] to logits `[N]`."""
        return cast(torch.Tensor, self.pointwise(self.strided(stacks).flatten(1))).squeeze(1)
