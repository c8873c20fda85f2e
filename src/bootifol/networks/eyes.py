"""Eyes: a small convolutional network that finds 64 points in a frame; their places are kept as whole numbers once it
rests."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from bootifol.types import Frames, FrameStates

POINTS = 64
"""Points that the eyes follow in a frame."""

STATE_SIZE = 2 * POINTS
"""Z, numbers in a state: where each point is, across and down."""

VIEW = STATE_SIZE // 2
"""Numbers in each of the two halves of a state, as the paper's s has two: 32 points each."""

_CELLS = 32
"""Cells along each side of the map, or a few more."""

_LEVELS = 127 / 4
"""States are kept in steps of 4 / 127, from -4 to 4 standard deviations."""

_FRAMES_AT_ONCE = 256
"""Frames in one pass, which bounds the memory."""


class Eyes(nn.Module):
    """Three convolutions to a map of about 32 x 32 cells, and where in it 64 points are.

    A point is where one mixture of the map's features is strongest: across, the mean column under a softmax over
    columns, each with its strongest cell; down, likewise with rows. So a state says in numbers what an agent must know,
    where things are, to a fraction of a pixel. (Points by a softmax over space: Finn et al., "Deep Spatial Autoencoders
    for Visuomotor Learning", 2016; over one axis at a time: Jakab et al., "Unsupervised Learning of Object Landmarks
    through Conditional Image Generation", 2018.)

    Args:
        video_size: S, the (square) pictures' side in pixels.
        width: features of a cell.
    """

    feature_size = STATE_SIZE

    def __init__(self, video_size: int, width: int) -> None:
        super().__init__()
        self.width = width
        stride = max(video_size // _CELLS, 1)
        self.convolutions = nn.Sequential(
            nn.Conv2d(3, width, max(2 * stride, 3), stride, (stride + 1) // 2),
            nn.ReLU(),
            nn.Conv2d(width, width, 3, 1, 1),
            nn.ReLU(),
            nn.Conv2d(width, width, 3, 1, 1),
            nn.ReLU(),
        )
        self.points = nn.Linear(width, POINTS)
        # Without parameters: what a thing's place varies by differs from thing to thing, and all of it matters.
        self.normalization = nn.BatchNorm1d(STATE_SIZE, affine=False)
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, frames: Tensor) -> Tensor:
        """States float32 `[N, Z]` of frames uint8 `[N, S, S, 3]`, each number about of mean 0 and variance 1."""
        pictures = frames.permute(0, 3, 1, 2).float() / 255 - 0.5
        cells = self.convolutions(pictures).permute(0, 2, 3, 1)
        places = [self._places(cells.amax(rows_or_columns)) for rows_or_columns in (1, 2)]
        normalized: Tensor = self.normalization(torch.stack(places, -1).flatten(1))
        return normalized

    def _places(self, cells: Tensor) -> Tensor:
        """Mean places float32 `[N, POINTS]` in [-1, 1] along an axis, of its strongest cells `[N, axis, width]`."""
        chances = self.points(cells).float().softmax(1)
        axis = torch.linspace(-1.0, 1.0, cells.shape[1], device=cells.device)
        # A matrix of one column: onnxruntime 1.32 multiplies what is transposed with a vector wrongly.
        places: Tensor = (chances.transpose(1, 2) @ axis[:, None]).squeeze(-1)
        return places

    def states(self, frames: Frames) -> FrameStates:
        """The same in whole numbers, int8 `[N, Z]`, of frames uint8 `[N, S, S, 3]`, without gradients and, whatever the
        mode, with the running statistics: what is seen of a frame depends on no other."""
        learning = self.training
        self.eval()
        device = next(self.parameters()).device
        states = np.empty((len(frames), STATE_SIZE), np.int8)
        with torch.inference_mode():
            for first in range(0, len(frames), _FRAMES_AT_ONCE):
                part = slice(first, first + _FRAMES_AT_ONCE)
                seen = self(torch.from_numpy(frames[part]).to(device))
                states[part] = whole_states(seen).cpu().numpy()
        self.train(learning)
        return states


def whole_states(seen: Tensor) -> Tensor:
    """States int8, as they are kept, of what the eyes make of frames, float32 of any shape."""
    return torch.round(seen * _LEVELS).clamp_(-127, 127).to(torch.int8)


def as_features(states: Tensor) -> Tensor:
    """States float32, of about unit variance, of whole ones int8, of any shape."""
    return states.float().div_(_LEVELS)


def rounding(states: Tensor, generator: np.random.Generator) -> Tensor:
    """Noise as large as what keeping whole numbers loses, of the shape of `states`."""
    noise = generator.uniform(-0.5, 0.5, states.shape).astype(np.float32)
    return torch.from_numpy(noise).to(states.device) / _LEVELS
