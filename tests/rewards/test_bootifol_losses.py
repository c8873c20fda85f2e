import math

import pytest
import torch
from benchmarks.plain import alignment as plain

from bootifol.rewards.bootifol import losses


def test_multiview_loss_by_hand() -> None:
    # Two frames; view vectors along the axes, tau = 1. Cosines a.b: [[1, 0], [1, 0]] (b_0 = a_0's direction,
    # b_1 orthogonal to both a).
    a = torch.tensor([[2.0, 0.0], [3.0, 0.0]])
    b = torch.tensor([[5.0, 0.0], [0.0, 7.0]])
    e = math.e
    to_second = -math.log(e / (e + 1)) - math.log(1 / (e + 1))
    to_first = -math.log(e / (e + e)) - math.log(1 / (1 + 1))
    assert losses.multiview_loss(a, b, 1.0).item() == pytest.approx((to_second + to_first) / 2, rel=1e-6)


def test_triplet_loss_by_hand() -> None:
    anchor = torch.tensor([[0.0, 0.0], [1.0, 1.0]])
    positive = torch.tensor([[1.0, 0.0], [1.0, 1.0]])  # mean squares 0.5 and 0
    negative = torch.tensor([[0.5, 0.5], [4.0, 1.0]])  # mean squares 0.25 and 4.5 (beyond the margin)
    assert losses.triplet_loss(anchor, positive, negative, 1.0).item() == pytest.approx(
        (0.5 + 0.75 + 0 + 0) / 2
    )


def test_autoencoder_loss_by_hand() -> None:
    picture = torch.zeros(1, 3, 2, 2)
    decoded = torch.zeros(1, 3, 2, 2)
    decoded[0, 0, 0, 0], decoded[0, 2, 1, 1] = 3.0, 1.0
    assert losses.autoencoder_loss(picture, decoded).item() == pytest.approx((9 + 1) / 12)


def test_autoencoder_loss_sums_the_pictures_of_a_whole_step_exactly() -> None:
    decoded = torch.rand(1952, 3, 64, 64, generator=torch.Generator().manual_seed(0))
    exact = decoded.double().square().mean().item()
    assert losses.autoencoder_loss(torch.zeros(()), decoded).item() == pytest.approx(exact, rel=1e-5)


def test_prediction_loss_by_hand() -> None:
    # One video of 4 states along two axes, predictions after frame 1 for states 2 and 3, tau = 1.
    states = torch.tensor([[[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]])
    predicted = torch.tensor([[[2.0, 0.0], [2.0, 0.0]]])
    e = math.e
    first = -math.log(e / (2 * e + 2))  # state 2 is along the prediction, so is state 0; 1 and 3 are not
    second = -math.log(1 / (2 * e + 2))
    loss = losses.prediction_loss(predicted, states, 1, 1.0)
    assert loss.item() == pytest.approx((first + second) / 2, rel=1e-6)


def test_sequence_loss_by_hand() -> None:
    # Experts agree with each other (cosine 1); the others do not (cosine 0); the first other looks like an expert.
    expert = torch.tensor([[1.0, 0.0], [2.0, 0.0]])
    other = torch.tensor([[3.0, 0.0], [0.0, 1.0]])
    e = math.e
    of_expert = -math.log(e / (e + e + 1))
    of_first_other = -math.log(1 / (1 + e + e))
    of_second_other = -math.log(1 / (1 + 1 + 1))
    expected = (of_expert + (of_first_other + of_second_other) / 2) / 2
    assert losses.sequence_loss(expert, other, 1.0).item() == pytest.approx(expected, rel=1e-6)


def test_the_next_video_of_the_class_is_the_positive() -> None:
    expert = torch.eye(4)[:3].repeat_interleave(1, 0)
    expert[1] = torch.tensor(
        [1.0, 1.0, 0.0, 0.0]
    )  # cos(0, 1) = cos(1, 0) = 0.707, cos(1, 2) = 0, cos(2, 0) = 0
    other = torch.eye(4)[3:].repeat(3, 1)  # orthogonal to all experts
    cosine, tau = 1 / math.sqrt(2), 0.5
    of_expert = (
        -math.log(math.exp(cosine / tau) / (math.exp(cosine / tau) + 3))  # 0 with 1
        - math.log(1 / (1 + 3))  # 1 with 2
        - math.log(1 / (1 + 3))  # 2 with 0
    ) / 3
    of_other = -math.log(math.exp(1 / tau) / (math.exp(1 / tau) + 3))
    loss = losses.sequence_loss(expert, other, tau)
    assert loss.item() == pytest.approx((of_expert + of_other) / 2, rel=1e-6)


def test_all_agree_with_the_slow_version_from_the_equations() -> None:
    torch.manual_seed(0)
    states = torch.randn(3, 9, 128)
    every = states.flatten(0, 1)
    tau = plain.TEMPERATURE
    torch.testing.assert_close(
        losses.multiview_loss(every[:, :64], every[:, 64:], tau),
        plain.multiview_loss(every[:, :64], every[:, 64:]),
        rtol=1e-4,
        atol=0,
    )
    triplets = [(0, 1, 5), (4, 2, 8), (8, 7, 3)]
    close = 0.5 * states  # near enough that the margin matters
    picked = [torch.stack([close[:, t[i]] for t in triplets], 1).flatten(0, 1) for i in range(3)]
    torch.testing.assert_close(
        losses.triplet_loss(picked[0], picked[1], picked[2], 1.0),
        torch.stack([plain.triplet_loss(video, triplets) for video in close]).mean(),
    )
    predicted = torch.randn(3, 2, 128)
    torch.testing.assert_close(
        losses.prediction_loss(predicted, states, 5, tau),
        torch.stack([plain.prediction_loss(predicted[i], states[i], 5) for i in range(3)]).mean(),
        rtol=1e-4,
        atol=0,
    )
    torch.testing.assert_close(
        losses.sequence_loss(states[:, 0], states[:, 1], tau),
        plain.sequence_loss(states[:, 0], states[:, 1]),
        rtol=1e-4,
        atol=0,
    )


def test_low_precision_inputs_are_summed_in_float32() -> None:
    torch.manual_seed(0)
    a, b = torch.randn(40, 64).bfloat16(), torch.randn(40, 64).bfloat16()
    loss = losses.multiview_loss(a, b, 0.07)
    assert loss.dtype == torch.float32
    torch.testing.assert_close(loss, losses.multiview_loss(a.float(), b.float(), 0.07))
