"""The two-view frame encoder g_theta (paper, Table "Architecture of the image encoding function")."""

from __future__ import annotations

from itertools import pairwise
from typing import cast

import torch
from torch import nn

from bootifol.errors import BootifolError
from bootifol.networks.strided_convolution import KERNEL, StridedConvolution, small_size

VIEW_SIZE = 64
"""Numbers per view; a state s has two views, hence 128 (the size the LSTM and the decoder read)."""

STATE_SIZE = 2 * VIEW_SIZE

WIDTHS = (64, 128, 256, 512)
"""Channels of the 5x5 stride-2 layers in the paper."""

HIDDEN_WIDTH = 512
"""Channels of the 1x1 layers in the paper."""


def picture_sizes(video_size: int) -> list[int]:
    """The picture's side before and after every 5x5 stride-2 layer, down to 1 pixel.

    64 gives [64, 30, 13, 5, 1], the paper's four layers; 32 gives [32, 14, 5, 1]: the same network without
    its last strided layer. Layers are added until one pixel is left, so other sizes work where that happens.

    Raises:
        BootifolError: the size does not come down to exactly one pixel in two to four layers.
    """
    sizes = [video_size]
    while sizes[-1] >= KERNEL and len(sizes) <= len(WIDTHS):
        sizes.append(small_size(sizes[-1]))
    if sizes[-1] != 1 or len(sizes) < 3:
        raise BootifolError(
            f"the frame encoder cannot read {video_size}x{video_size} videos: its 5x5 stride-2 layers must "
            "end on one pixel; use videos of 64x64 (the paper) or 32x32"
        )
    return sizes


def strided_layers(
    channels: int, video_size: int, width_divisor: int, leak: float
) -> tuple[nn.Sequential, int]:
    """5x5 stride-2 convolutions down to one pixel, each without bias and followed by BatchNorm and LeakyReLU.

    Args:
        channels: of the pictures.
        video_size: their side in pixels.
        width_divisor: divides every width; 1 is the paper's network.
        leak: slope of LeakyReLU below zero.

    Returns:
        The layers, and the channels of their last picture.
    """
    widths = [channels, *(width // width_divisor for width in WIDTHS[: len(picture_sizes(video_size)) - 1])]
    layers = nn.Sequential()
    for before, after in pairwise(widths):
        layers.append(StridedConvolution(before, after))
        layers.append(nn.BatchNorm2d(after))
        layers.append(nn.LeakyReLU(leak))
    return layers, widths[-1]


class ViewEncoder(nn.Module):
    """One of g_theta1, g_theta2, or a whole picture's encoder: strided 5x5 convolutions, then two 1x1 convolutions.

    The 1x1 convolutions see one pixel, so they are linear layers. Every layer but the last is followed by BatchNorm
    and LeakyReLU and has no bias of its own (the BatchNorm has one).

    Args:
        channels: of the view, 1 for L and 2 for ab; 3 for a whole picture.
        video_size: the picture's side in pixels.
        width_divisor: divides every hidden width; 1 is the paper's network.
        leak: slope of LeakyReLU below zero.
        numbers: what a view is encoded into.
    """

    def __init__(
        self,
        channels: int,
        video_size: int,
        width_divisor: int = 1,
        leak: float = 0.2,
        numbers: int = VIEW_SIZE,
    ) -> None:
        super().__init__()
        hidden = HIDDEN_WIDTH // width_divisor
        self.strided, width = strided_layers(channels, video_size, width_divisor, leak)
        self.pointwise = nn.Sequential(
            nn.Linear(width, hidden, bias=False),
            nn.BatchNorm1d(hidden),
            nn.LeakyReLU(leak),
            nn.Linear(hidden, numbers),
        )

    def forward(self, view: torch.Tensor) -> torch.Tensor:
        """`[N, C, H, W]` to `[N, numbers]`."""
        return cast(torch.Tensor, self.pointwise(self.strided(view).flatten(1)))


class FrameEncoder(nn.Module):
    """g_theta: s = [g_theta1(L), g_theta2(ab)].

    Args:
        video_size: side of the pictures in pixels.
        width_divisor: divides the channels of the hidden layers.
        leak: slope of LeakyReLU below zero.
    """

    def __init__(self, video_size: int, width_divisor: int = 1, leak: float = 0.2) -> None:
        super().__init__()
        self.lightness = ViewEncoder(1, video_size, width_divisor, leak)
        self.color = ViewEncoder(2, video_size, width_divisor, leak)

    def forward(self, lightness: torch.Tensor, color: torch.Tensor) -> torch.Tensor:
        """Views L `[N, 1, H, W]` and ab `[N, 2, H, W]` to states `[N, 128]`: 64 numbers of L, then 64 of ab."""
        return torch.cat([self.lightness(lightness), self.color(color)], dim=1)
