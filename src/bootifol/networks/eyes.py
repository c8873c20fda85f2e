"""Eyes: a small convolutional network that makes 128 numbers of a frame, kept as whole ones once it rests."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from bootifol.types import Frames, FrameStates

VIEW = 64
"""Numbers in each of the two views of a frame, as in the paper's s = [g_1, g_2]."""

STATE_SIZE = 2 * VIEW
"""Z, numbers in a state."""

_CELLS = 8
"""Cells along each side of the last map, whatever the size of the pictures."""

_SCALE = 8.0
"""Length of a view: the square root of its 64 numbers, so that each is about 1."""

_LEVELS = 127 / 4
"""States are kept in steps of 4 / 127, from -4 to 4."""

_FRAMES_AT_ONCE = 256
"""Frames in one pass, which bounds the memory."""


class Eyes(nn.Module):
    """Three convolutions to a map of 8 x 8 cells, and two linear views of it.

    Args:
        video_size: S, the (square) pictures' side in pixels.
        channels: features of a cell.
        width: channels of the two inner layers.
    """

    feature_size = STATE_SIZE

    def __init__(self, video_size: int, channels: int, width: int) -> None:
        super().__init__()
        self.channels, self.width = channels, width
        # The last layer halves the map.
        stride = max(video_size // (2 * _CELLS), 1)
        self.convolutions = nn.Sequential(
            nn.Conv2d(3, width, 2 * stride, stride, (stride + 1) // 2),
            nn.ReLU(),
            nn.Conv2d(width, width, 3, 1, 1),
            nn.ReLU(),
            nn.Conv2d(width, channels, 4, 2, 1),
            nn.Tanh(),
        )
        with torch.no_grad():
            cells = self.convolutions(torch.zeros(1, 3, video_size, video_size)).numel()
        self.views = nn.ModuleList([nn.Linear(cells, VIEW) for _ in range(2)])
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, frames: Tensor) -> Tensor:
        """States float32 `[N, Z]` of frames uint8 `[N, S, S, 3]`; each half has length 8."""
        pictures = frames.permute(0, 3, 1, 2).float() / 255 - 0.5
        cells = self.convolutions(pictures).permute(0, 2, 3, 1).flatten(1)
        views = [nn.functional.normalize(view(cells).float(), dim=1) for view in self.views]
        return _SCALE * torch.cat(views, 1)

    def states(self, frames: Frames) -> FrameStates:
        """The same in whole numbers, int8 `[N, Z]`, of frames uint8 `[N, S, S, 3]`, without gradients."""
        device = next(self.parameters()).device
        states = np.empty((len(frames), STATE_SIZE), np.int8)
        with torch.inference_mode():
            for first in range(0, len(frames), _FRAMES_AT_ONCE):
                part = slice(first, first + _FRAMES_AT_ONCE)
                seen = self(torch.from_numpy(frames[part]).to(device))
                whole = torch.round(seen * _LEVELS).clamp_(-127, 127)
                states[part] = whole.to(torch.int8).cpu().numpy()
        return states


def as_features(states: Tensor) -> Tensor:
    """States float32, of about unit variance, of whole ones int8, of any shape."""
    return states.float().div_(_LEVELS)


def rounding(states: Tensor, generator: np.random.Generator) -> Tensor:
    """Noise as large as what keeping whole numbers loses, of the shape of `states`."""
    noise = generator.uniform(-0.5, 0.5, states.shape).astype(np.float32)
    return torch.from_numpy(noise).to(states.device) / _LEVELS
