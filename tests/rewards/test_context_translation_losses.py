import pytest
import torch

from bootifol.rewards.context_translation import losses

PICTURES = (1, 3, 2, 2)


def test_translation_loss_by_hand() -> None:
    translated, target = torch.zeros(PICTURES), torch.zeros(PICTURES)
    translated[0, 0, 0, 0], target[0, 2, 1, 1] = 3.0, -1.0
    assert losses.translation_loss(translated, target).item() == pytest.approx((9 + 1) / 12)


def test_reconstruction_loss_by_hand() -> None:
    decoded, target = torch.full(PICTURES, 0.5), torch.zeros(PICTURES)
    target[0, 1, 0, 1] = 1.5
    assert losses.reconstruction_loss(decoded, target).item() == pytest.approx((11 * 0.25 + 1) / 12)


def test_alignment_loss_by_hand() -> None:
    translated = torch.tensor([[1.0, 2.0], [0.0, 0.0]])
    features = torch.tensor([[0.0, 2.0], [3.0, 0.0]])
    assert losses.alignment_loss(translated, features).item() == pytest.approx((1 + 9) / 4)


def test_imitation_cost_by_hand() -> None:
    features, translated = torch.tensor([[1.0, 1.0], [0.0, 0.0]]), torch.tensor([[0.0, 3.0], [0.0, 0.0]])
    pictures, drawn = torch.zeros(2, 3, 1, 2), torch.zeros(2, 3, 1, 2)
    drawn[1, 2, 0, 1], drawn[1, 0, 0, 0] = 2.0, 1.0
    cost = losses.imitation_cost(features, translated, pictures, drawn, image_weight=0.1)
    torch.testing.assert_close(cost, torch.tensor([1.0 + 4.0, 0.1 * (4.0 + 1.0)]))


def test_all_agree_with_the_slow_version_from_the_equations() -> None:
    torch.manual_seed(0)
    one, two = torch.randn(4, 3, 5, 5), torch.randn(4, 3, 5, 5)
    z, z_translated = torch.randn(4, 7), torch.randn(4, 7)
    summed = [
        sum(float((p - q) ** 2) for p, q in zip(a, b, strict=True))
        for a, b in zip(z, z_translated, strict=True)
    ]
    drawn = [
        sum(float((p - q) ** 2) for p, q in zip(a.flatten(), b.flatten(), strict=True))
        for a, b in zip(one, two, strict=True)
    ]
    assert losses.alignment_loss(z_translated, z).item() == pytest.approx(sum(summed) / (4 * 7), rel=1e-4)
    of_pictures = pytest.approx(sum(drawn) / (4 * 3 * 5 * 5), rel=1e-4)
    assert losses.translation_loss(two, one).item() == of_pictures
    assert losses.reconstruction_loss(two, one).item() == of_pictures
    cost = losses.imitation_cost(z, z_translated, one, two, 0.3)
    expected = [feature + 0.3 * picture for feature, picture in zip(summed, drawn, strict=True)]
    torch.testing.assert_close(cost, torch.tensor(expected), rtol=1e-4, atol=0)


def test_low_precision_inputs_are_compared_in_float32() -> None:
    torch.manual_seed(0)
    a, b = torch.randn(4, 8).bfloat16(), torch.randn(4, 8).bfloat16()
    loss = losses.alignment_loss(a, b)
    assert loss.dtype == torch.float32
    torch.testing.assert_close(loss, losses.alignment_loss(a.float(), b.float()))
