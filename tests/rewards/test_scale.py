"""The scale of the distance reward against values worked out by hand."""

from __future__ import annotations

import numpy as np
import torch

from bootifol.rewards.bootifol.scale import MEMORY, DistanceScale


def test_means_are_kept_for_every_time_step() -> None:
    scale = DistanceScale()
    assert not scale.known
    scale.observe(np.array([0, 1, 3]), np.array([0.5, 2.0, 8.0]))
    scale.observe(np.array([1, 2]), np.array([4.0, 5.0]))
    assert scale.known
    np.testing.assert_allclose(scale.means, [0.5, MEMORY * 2 + (1 - MEMORY) * 4, 5.0, 8.0])


def test_a_random_distance_is_worth_0_and_none_1_at_every_time_step() -> None:
    scale = DistanceScale()
    scale.observe(np.arange(4), np.array([1.0, 2.0, 4.0, 8.0]))
    distances = torch.tensor([2.0, 0.0, 4.0])
    np.testing.assert_allclose(scale.rewards(-distances), [0.0, 1.0, 0.5])


def test_frames_never_met_take_the_scale_of_their_neighbors() -> None:
    scale = DistanceScale()
    scale.observe(np.array([1, 3]), np.array([2.0, 4.0]))
    np.testing.assert_allclose(scale.rewards(-torch.ones(5)), [1 / 2, 2 / 3, 3 / 4, 3 / 4, 3 / 4])
