"""ViRL's four networks in one module; the two halves of the siamese network share every parameter."""

from __future__ import annotations

from typing import cast

import torch
from torch import nn

from bootifol.networks.frame_decoder import FrameDecoder
from bootifol.networks.frame_encoders import STATE_SIZE, ViewEncoder
from bootifol.networks.sequence_encoder import ENCODING_SIZE, SequenceEncoder
from bootifol.rewards.virl.config import VirlConfig

RGB = 3

LEAK = 0.01
"""Slope of LeakyReLU below zero."""


class SequenceDecoder(nn.Module):
    """omega's counterpart: unrolls the encoding of a video into the encodings of its frames, first to last.

    A linear layer makes the first input of a 2-layer LSTM, whose output is fed back into it for every further frame.
    """

    def __init__(self) -> None:
        super().__init__()
        self.input = nn.Linear(ENCODING_SIZE, STATE_SIZE)
        self.lstm = nn.LSTM(STATE_SIZE, STATE_SIZE, num_layers=2, batch_first=True)

    def forward(self, encoding: torch.Tensor, frames: int) -> torch.Tensor:
        """h_T `[B, 128]` to `[B, frames, 128]`."""
        output = self.input(encoding)[:, None]
        memory = None
        outputs = []
        for _ in range(frames):
            output, memory = self.lstm(output, memory)
            outputs.append(output)
        return torch.cat(outputs, dim=1)


class VirlNetworks(nn.Module):
    """Conv, LSTM, and the decoders of both."""

    def __init__(self, config: VirlConfig, video_size: int) -> None:
        super().__init__()
        self.frame_encoder = ViewEncoder(RGB, video_size, config.width_divisor, LEAK, STATE_SIZE)
        self.frame_decoder = FrameDecoder(video_size, config.width_divisor, LEAK)
        self.sequence_encoder = SequenceEncoder()
        self.sequence_decoder = SequenceDecoder()

    def encode_frames(self, pictures: torch.Tensor) -> torch.Tensor:
        """Pictures `[N, 3, H, W]` in [0, 1] to e `[N, 128]` in (0, 1), float32."""
        return cast(torch.Tensor, self.frame_encoder(pictures)).float().sigmoid()

    def encode_sequences(self, frame_encodings: torch.Tensor) -> torch.Tensor:
        """e `[B, T + 1, 128]` to h `[B, T + 1, 128]` in (0, 1); `h[:, t]` encodes the frames up to `t`."""
        outputs, _ = self.sequence_encoder(frame_encodings)
        return cast(torch.Tensor, outputs.sigmoid())
