import math

import pytest
import torch

from bootifol.rewards.virl import losses


def test_siamese_loss_by_hand() -> None:
    anchor = torch.tensor([[0.0, 0.0], [1.0, 1.0]])
    positive = torch.tensor([[0.3, 0.4], [1.0, 1.0]])  # distances 0.5 and 0
    negative = torch.tensor([[0.0, 0.8], [4.0, 5.0]])  # distances 0.8 and 5 (beyond the margin)
    loss = losses.siamese_loss(anchor, positive, negative, 1.0)
    assert loss.item() == pytest.approx((0.5 + 0.2 + 0 + 0) / 2)


def test_reconstruction_loss_by_hand() -> None:
    pictures, decoded = torch.zeros(1, 3, 2, 2), torch.zeros(1, 3, 2, 2)
    decoded[0, 0, 0, 0], decoded[0, 2, 1, 1] = 3.0, 1.0
    assert losses.reconstruction_loss(pictures, decoded).item() == pytest.approx((9 + 1) / 12)


def plain_siamese(anchor: torch.Tensor, positive: torch.Tensor, negative: torch.Tensor, rho: float) -> float:
    """Eq. (3) with (4), one frame of one video and one dimension at a time."""

    def distance(one: torch.Tensor, other: torch.Tensor) -> float:
        return math.sqrt(sum((float(a) - float(b)) ** 2 for a, b in zip(one, other, strict=True)))

    videos = []
    for i, p, n in zip(anchor, positive, negative, strict=True):
        pairs = [distance(i[t], p[t]) + max(rho - distance(i[t], n[t]), 0.0) for t in range(len(i))]
        videos.append(sum(pairs) / len(pairs))
    return sum(videos) / len(videos)


def test_frames_agree_with_the_slow_version_from_the_equation() -> None:
    torch.manual_seed(0)
    anchor, positive, negative = torch.rand(3, 2, 5, 8)
    loss = losses.siamese_loss(anchor, positive, negative, 1.2)
    assert loss.item() == pytest.approx(plain_siamese(anchor, positive, negative, 1.2), rel=1e-5)


def test_a_step_along_the_gradient_brings_the_positive_near_and_the_negative_far() -> None:
    torch.manual_seed(0)
    anchor, positive, negative = (torch.rand(4, 8, requires_grad=True) for _ in range(3))

    def distances() -> tuple[float, float]:
        return (anchor - positive).norm().item(), (anchor - negative).norm().item()

    near, far = distances()
    losses.siamese_loss(anchor, positive, negative, 10.0).backward()
    with torch.no_grad():
        positive -= 0.1 * positive.grad
        negative -= 0.1 * negative.grad
    assert distances()[0] < near
    assert distances()[1] > far


def test_equal_encodings_have_a_finite_gradient() -> None:
    same = torch.rand(3, 8, requires_grad=True)
    losses.siamese_loss(same, same.detach().clone(), same.detach().clone(), 1.0).backward()
    assert torch.isfinite(same.grad).all()


def test_low_precision_inputs_are_summed_in_float32() -> None:
    torch.manual_seed(0)
    parts = torch.rand(3, 40, 64).bfloat16()
    loss = losses.siamese_loss(*parts, 1.0)
    assert loss.dtype == torch.float32
    torch.testing.assert_close(loss, losses.siamese_loss(*parts.float(), 1.0))
