"""The frame decoder q_gamma (paper, Table "Architecture of the image decoding function")."""

from __future__ import annotations

from typing import cast

import torch
from torch import nn

from bootifol.networks.frame_encoders import HIDDEN_WIDTH, KERNEL, STATE_SIZE, STRIDE, WIDTHS, picture_sizes


class FrameDecoder(nn.Module):
    """State to picture: two 1x1 convolutions, then transposed 5x5 stride-2 convolutions (1, 5, 13, 30, 64 pixels).

    Output padding is whatever brings a layer back to the size the encoder had: 0, 0, 1, 1 for 64 pixels.

    Args:
        video_size: the picture's side in pixels.
        width_divisor: divides every hidden width; 1 is the paper's network.
        leak: slope of LeakyReLU below zero.
    """

    def __init__(self, video_size: int, width_divisor: int = 1, leak: float = 0.2) -> None:
        super().__init__()
        sizes = picture_sizes(video_size)[::-1]
        hidden = HIDDEN_WIDTH // width_divisor
        widths = [hidden, *(width // width_divisor for width in WIDTHS[: len(sizes) - 2][::-1]), 3]
        layers: list[nn.Module] = [
            nn.Conv2d(STATE_SIZE, hidden, 1),
            nn.LeakyReLU(leak),
            nn.Conv2d(hidden, hidden, 1, bias=False),
            nn.BatchNorm2d(hidden),
            nn.LeakyReLU(leak),
        ]
        for index, (before, after) in enumerate(zip(widths, widths[1:], strict=False)):
            last = index == len(widths) - 2
            padding = sizes[index + 1] - ((sizes[index] - 1) * STRIDE + KERNEL)
            layers.append(
                nn.ConvTranspose2d(before, after, KERNEL, STRIDE, output_padding=padding, bias=last)
            )
            if not last:
                layers += [nn.BatchNorm2d(after), nn.LeakyReLU(leak)]
        self.layers = nn.Sequential(*layers)

    def forward(self, states: torch.Tensor) -> torch.Tensor:
        """States `[N, 128]` to normalized Lab `[N, 3, H, W]`."""
        return cast(torch.Tensor, self.layers(states[:, :, None, None]))
