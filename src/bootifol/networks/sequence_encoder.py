"""The sequence encoder f_omega and the next-state predictor d_phi (paper, "Network architectures")."""

from __future__ import annotations

from typing import cast

import torch
from torch import nn

from bootifol.networks.frame_encoders import STATE_SIZE

ENCODING_SIZE = STATE_SIZE

Memory = tuple[torch.Tensor, torch.Tensor]
"""The LSTM's hidden and cell state, each `[2, B, 128]`."""


class SequenceEncoder(nn.Module):
    """f_omega: a 2-layer LSTM, then one linear layer on every output.

    Causal, so one pass over a video gives the encodings of all its prefixes o_{0:t}.
    """

    def __init__(self) -> None:
        super().__init__()
        self.lstm = nn.LSTM(STATE_SIZE, ENCODING_SIZE, num_layers=2, batch_first=True)
        self.output = nn.Linear(ENCODING_SIZE, ENCODING_SIZE)

    def forward(self, states: torch.Tensor, memory: Memory | None = None) -> tuple[torch.Tensor, Memory]:
        """Encodes every prefix.

        Args:
            states: `[B, T, 128]`.
            memory: what an earlier call returned, to go on from there; None at the first frame.

        Returns:
            z `[B, T, 128]`, of which `z[:, t]` encodes the states up to `t`; and the memory after the last one.
        """
        outputs, memory = self.lstm(states, memory)
        return cast(torch.Tensor, self.output(outputs)), cast(Memory, memory)


class StatePredictor(nn.Module):
    """d_phi: from the encoding z_t of a sequence to a prediction of the next state s_{t+1}."""

    def __init__(self, leak: float = 0.2) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(ENCODING_SIZE, ENCODING_SIZE), nn.LeakyReLU(leak), nn.Linear(ENCODING_SIZE, STATE_SIZE)
        )

    def forward(self, encoding: torch.Tensor) -> torch.Tensor:
        """`[..., 128]` to `[..., 128]`."""
        return cast(torch.Tensor, self.layers(encoding))
