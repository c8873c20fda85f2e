"""The part of the frame encoder that learns where a frozen backbone has read the frames (the paper's Eff-BootIfOL)."""

from __future__ import annotations

from typing import cast

import torch
from torch import nn

from bootifol.networks.frame_encoders import HIDDEN_WIDTH, STATE_SIZE


class FeatureEncoder(nn.Module):
    """g_theta after the backbone: a layer to 512 numbers, LeakyReLU, a layer to the state's 128.

    Args:
        feature_size: F, of a frame's features (1280 of EfficientNet-B0).
        leak: slope of LeakyReLU below zero.
    """

    def __init__(self, feature_size: int, leak: float = 0.2) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(feature_size, HIDDEN_WIDTH), nn.LeakyReLU(leak), nn.Linear(HIDDEN_WIDTH, STATE_SIZE)
        )

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """`[N, F]` to states `[N, 128]`."""
        return cast(torch.Tensor, self.layers(features))
