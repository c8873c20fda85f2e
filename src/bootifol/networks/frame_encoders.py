"""The two-view frame encoder g_theta (paper, Table "Architecture of the image encoding function")."""

from __future__ import annotations

from typing import cast

import torch
from torch import nn

from bootifol.errors import BootifolError

VIEW_SIZE = 64
"""Numbers per view; a state s has two views, hence 128 (the size the LSTM and the decoder read)."""

STATE_SIZE = 2 * VIEW_SIZE

KERNEL = 5
STRIDE = 2
WIDTHS = (64, 128, 256, 512)
"""Channels of the 5x5 stride-2 layers in the paper."""

HIDDEN_WIDTH = 512
"""Channels of the 1x1 layers in the paper."""


def picture_sizes(video_size: int) -> list[int]:
    """The picture's side before and after every 5x5 stride-2 layer, down to 1 pixel.

    64 gives [64, 30, 13, 5, 1], the paper's four layers; 32 gives [32, 14, 5, 1]: the same network without
    its last strided layer. Layers are added until one pixel is left, so other sizes work where that happens.

    Raises:
        BootifolError: the size never reaches exactly one pixel within four layers.
    """
    sizes = [video_size]
    while sizes[-1] >= KERNEL and len(sizes) <= len(WIDTHS):
        sizes.append((sizes[-1] - KERNEL) // STRIDE + 1)
    if sizes[-1] != 1 or len(sizes) < 3:
        raise BootifolError(
            f"the frame encoder cannot read {video_size}x{video_size} videos: its 5x5 stride-2 layers must end on "
            "one pixel; use videos of 64x64 (the paper) or 32x32"
        )
    return sizes


class ViewEncoder(nn.Module):
    """One of g_theta1, g_theta2: strided 5x5 convolutions, then two 1x1 convolutions.

    Every layer but the last is convolution, BatchNorm, LeakyReLU. Convolutions before a BatchNorm have no bias
    (the BatchNorm has one).

    Args:
        channels: of the view, 1 for L and 2 for ab.
        video_size: the picture's side in pixels.
        width_divisor: divides every hidden width; 1 is the paper's network.
        leak: slope of LeakyReLU below zero.
    """

    def __init__(self, channels: int, video_size: int, width_divisor: int = 1, leak: float = 0.2) -> None:
        super().__init__()
        strided = len(picture_sizes(video_size)) - 1
        widths = [channels, *(width // width_divisor for width in WIDTHS[:strided])]
        hidden = HIDDEN_WIDTH // width_divisor
        layers: list[nn.Module] = []
        for before, after in zip(widths, widths[1:], strict=False):
            layers += [
                nn.Conv2d(before, after, KERNEL, STRIDE, bias=False),
                nn.BatchNorm2d(after),
                nn.LeakyReLU(leak),
            ]
        layers += [nn.Conv2d(widths[-1], hidden, 1, bias=False), nn.BatchNorm2d(hidden), nn.LeakyReLU(leak)]
        layers += [nn.Conv2d(hidden, VIEW_SIZE, 1)]
        self.layers = nn.Sequential(*layers)

    def forward(self, view: torch.Tensor) -> torch.Tensor:
        """`[N, C, H, W]` to `[N, 64]`."""
        return cast(torch.Tensor, self.layers(view)).flatten(1)


class FrameEncoder(nn.Module):
    """g_theta: s = [g_theta1(L), g_theta2(ab)]."""

    def __init__(self, video_size: int, width_divisor: int = 1, leak: float = 0.2) -> None:
        super().__init__()
        self.lightness = ViewEncoder(1, video_size, width_divisor, leak)
        self.color = ViewEncoder(2, video_size, width_divisor, leak)

    def forward(self, lab: torch.Tensor) -> torch.Tensor:
        """Normalized Lab `[N, 3, H, W]` to states `[N, 128]`; the first 64 numbers encode L, the others ab."""
        return torch.cat([self.lightness(lab[:, :1]), self.color(lab[:, 1:])], dim=1)
