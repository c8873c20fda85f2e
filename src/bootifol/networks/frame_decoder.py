"""The frame decoder q_gamma (paper, Table "Architecture of the image decoding function")."""

from __future__ import annotations

from typing import cast

import torch
from torch import nn

from bootifol.networks.frame_encoders import HIDDEN_WIDTH, STATE_SIZE, WIDTHS, picture_sizes
from bootifol.networks.strided_convolution import StridedTransposedConvolution


class FrameDecoder(nn.Module):
    """State to picture: two 1x1 convolutions, then transposed 5x5 stride-2 convolutions.

    The pictures grow through the sizes the encoder shrank them through (1, 5, 13, 30, 64 pixels). The 1x1
    convolutions see one pixel, so they are linear layers.

    Args:
        video_size: the picture's side in pixels.
        width_divisor: divides every hidden width; 1 is the paper's network.
        leak: slope of LeakyReLU below zero.
    """

    def __init__(self, video_size: int, width_divisor: int = 1, leak: float = 0.2) -> None:
        super().__init__()
        sizes = picture_sizes(video_size)[-2::-1]
        hidden = HIDDEN_WIDTH // width_divisor
        widths = [hidden, *(width // width_divisor for width in WIDTHS[: len(sizes) - 1][::-1])]
        self.pointwise = nn.Sequential(
            nn.Linear(STATE_SIZE, hidden),
            nn.LeakyReLU(leak),
            nn.Linear(hidden, hidden, bias=False),
            nn.BatchNorm1d(hidden),
            nn.LeakyReLU(leak),
        )
        self.strided = nn.Sequential()
        for before, after, size in zip(widths[:-1], widths[1:], sizes[:-1], strict=True):
            self.strided.append(StridedTransposedConvolution(before, after, size))
            self.strided.append(nn.BatchNorm2d(after))
            self.strided.append(nn.LeakyReLU(leak))
        self.strided.append(StridedTransposedConvolution(widths[-1], 3, sizes[-1], bias=True))

    def forward(self, states: torch.Tensor) -> torch.Tensor:
        """States `[N, 128]` to normalized Lab `[N, 3, H, W]`."""
        return cast(torch.Tensor, self.strided(self.pointwise(states)[:, :, None, None]))
