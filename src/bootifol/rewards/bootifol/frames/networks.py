"""The networks of the reward that sees single frames."""

from __future__ import annotations

from typing import cast

import torch
import torch.nn.functional as F
from torch import nn

from bootifol.networks.eyes import STATE_SIZE, VIEW, Eyes
from bootifol.rewards.bootifol.frames.config import FrameConfig

HIDDEN_DIM = 128
"""Width of the two hidden layers of the head."""


class FrameNetworks(nn.Module):
    """Eyes, the head that rewards a state, and the projections that L_E and L_T contrast.

    Args:
        config: see there.
        video_size: the pictures' side in pixels.
    """

    def __init__(self, config: FrameConfig, video_size: int) -> None:
        super().__init__()
        self.eyes = Eyes(video_size, config.width)
        self.projections = nn.ModuleList([nn.Linear(VIEW, VIEW) for _ in range(2)])
        self.head = nn.Sequential(
            nn.Linear(STATE_SIZE, HIDDEN_DIM),
            nn.ReLU(),
            nn.Linear(HIDDEN_DIM, HIDDEN_DIM),
            nn.ReLU(),
            nn.Linear(HIDDEN_DIM, 1),
        )

    def logits(self, states: torch.Tensor) -> torch.Tensor:
        """x `[...]` of states `[..., Z]`."""
        return cast(torch.Tensor, self.head(states)).squeeze(-1)

    def views(self, states: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """u and v `[..., 64]`, of length 1, of both halves of states `[..., Z]`: what L_E and what L_T contrast."""
        halves = zip(self.projections, torch.split(states, VIEW, -1), strict=True)
        u, v = (F.normalize(projection(half), dim=-1) for projection, half in halves)
        return u, v
