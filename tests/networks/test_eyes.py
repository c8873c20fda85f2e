"""Eyes: where things are, and of one frame alone."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from bootifol.networks.eyes import POINTS, STATE_SIZE, Eyes, as_features
from bootifol.types import Frames


def dots(columns: list[int], size: int = 32) -> Frames:
    """A bright dot in the middle row, at each column."""
    frames = np.zeros((len(columns), size, size, 3), np.uint8)
    for frame, column in zip(frames, columns, strict=True):
        frame[size // 2 - 1 : size // 2 + 1, column : column + 2] = 255
    return frames


def of_brightness() -> Eyes:
    """Eyes whose every point is the brightest spot."""
    eyes = Eyes(video_size=32, width=2)
    with torch.no_grad():
        for layer in eyes.convolutions:
            if isinstance(layer, torch.nn.Conv2d):
                layer.weight.zero_()
                layer.weight[:, :, 1, 1] = 1.0 / layer.in_channels
                assert layer.bias is not None
                layer.bias.zero_()
        eyes.points.weight.fill_(20.0)
    return eyes.eval()


def test_a_point_is_where_its_feature_is_strongest() -> None:
    columns = [2, 9, 16, 23, 28]
    with torch.no_grad():
        states = of_brightness()(torch.from_numpy(dots(columns))).reshape(len(columns), POINTS, 2)
    across, down = states[:, 0, 0], states[:, 0, 1]
    middles = 2 * (torch.tensor(columns) + 0.5) / 31 - 1
    assert across.numpy() == pytest.approx(middles.numpy(), abs=0.01)
    assert down.numpy() == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("size", [32, 48, 64, 84, 224])
def test_pictures_of_any_size_have_the_same_state_size(size: int) -> None:
    frames = np.random.default_rng(0).integers(0, 256, (3, size, size, 3), dtype=np.uint8)
    states = Eyes(size, 4).states(frames)
    assert states.shape == (3, STATE_SIZE)
    assert states.dtype == np.int8


def test_what_is_seen_of_a_frame_depends_on_no_other_even_while_they_learn() -> None:
    eyes = Eyes(32, 4).train()
    frames = np.random.default_rng(0).integers(0, 256, (5, 32, 32, 3), dtype=np.uint8)
    for _ in range(3):
        eyes(torch.from_numpy(frames))  # moves the running statistics
    together = eyes.states(frames)
    alone = np.concatenate([eyes.states(frame[None]) for frame in frames])
    assert (
        np.abs(together.astype(int) - alone).max() <= 1
    )  # the last bits of a convolution depend on the batch
    assert eyes.training


def test_whole_numbers_are_within_half_a_step() -> None:
    eyes = Eyes(32, 4).eval()
    frames = np.random.default_rng(0).integers(0, 256, (4, 32, 32, 3), dtype=np.uint8)
    with torch.no_grad():
        exact = eyes(torch.from_numpy(frames)).clamp(-4, 4)
    kept = as_features(torch.from_numpy(eyes.states(frames)))
    assert float((kept - exact).abs().max()) <= 0.5 * 4 / 127 + 1e-5
