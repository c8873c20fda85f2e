"""The sequence encoder f_omega and the next-state predictor d_phi (paper, "Network architectures")."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import torch
from torch import nn

from bootifol.networks.frame_encoders import STATE_SIZE

ENCODING_SIZE = STATE_SIZE

MOTION_MEMORY = 0.95
"""The scale of motion is an exponential average over about the last 20 training passes."""


@dataclass(frozen=True)
class Memory:
    """What f_omega remembers of the states it has read."""

    lstm: tuple[torch.Tensor, torch.Tensor]
    """The LSTM's hidden and cell state, each `[2, B, 128]`."""
    state: torch.Tensor
    """The last state, `[B, 1, 128]`, from which the next one's motion is measured."""


class SequenceEncoder(nn.Module):
    """f_omega: a 2-layer LSTM, then one linear layer on every output.

    Causal, so one pass over a video gives the encodings of all its prefixes o_{0:t}.

    Args:
        motion: beyond the paper: the LSTM also reads s_t - s_{t-1}, scaled to a mean square of 1. Neighboring frames
            differ little beside what tells one video from another, and an LSTM needs hundreds of steps to find out
            that it should subtract them.
    """

    motion_square: torch.Tensor

    def __init__(self, motion: bool = False) -> None:
        super().__init__()
        inputs = 2 * STATE_SIZE if motion else STATE_SIZE
        self.lstm = nn.LSTM(inputs, ENCODING_SIZE, num_layers=2, batch_first=True)
        self.output = nn.Linear(ENCODING_SIZE, ENCODING_SIZE)
        self.motion = motion
        if motion:
            self.register_buffer("motion_square", torch.zeros(()))

    def forward(self, states: torch.Tensor, memory: Memory | None = None) -> tuple[torch.Tensor, Memory]:
        """Encodes every prefix.

        Args:
            states: `[B, T, 128]`.
            memory: what an earlier call returned, to go on from there; None at the first frame.

        Returns:
            z `[B, T, 128]`, of which `z[:, t]` encodes the states up to `t`; and the memory after the last one.
        """
        inputs = self._with_motion(states, memory) if self.motion else states
        outputs, lstm = self.lstm(inputs, None if memory is None else memory.lstm)
        return cast(torch.Tensor, self.output(outputs)), Memory(lstm, states[:, -1:])

    def _with_motion(self, states: torch.Tensor, memory: Memory | None) -> torch.Tensor:
        """`[B, T, 256]`: states, then the change from the state before, which is 0 at the first frame."""
        before = states[:, :1] if memory is None else memory.state
        change = states - torch.cat([before, states[:, :-1]], dim=1)
        # A single state is a prediction fed back, whose change says little about videos.
        if self.training and states.shape[1] > 1:
            with torch.no_grad():
                square = change.square().mean()
                known = self.motion_square > 0
                self.motion_square.copy_(
                    torch.where(known, self.motion_square.lerp(square, 1 - MOTION_MEMORY), square)
                )
        return torch.cat([states, change * (self.motion_square + 1e-8).rsqrt()], dim=2)


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
