import math

import pytest
import torch

from bootifol.rewards.gaifo import losses


def sigmoid(x: float) -> float:
    return 1 / (1 + math.exp(-x))


def test_discriminator_loss_by_hand() -> None:
    # D = 3/4 and 1/2 on the expert's stacks, 1/4 on the other one.
    expert, other = torch.tensor([math.log(3), 0.0]), torch.tensor([-math.log(3)])
    expected = -(math.log(3 / 4) + math.log(1 / 2)) / 2 - math.log(1 - 1 / 4)
    assert losses.discriminator_loss(expert, other).item() == pytest.approx(expected, rel=1e-6)


def test_a_discriminator_that_knows_nothing_has_two_log_two() -> None:
    assert losses.discriminator_loss(torch.zeros(5), torch.zeros(3)).item() == pytest.approx(2 * math.log(2))


def test_rewards_by_hand() -> None:
    """-log(1 - D) for D = 3/4, 1/2, 1/4."""
    logits = torch.tensor([math.log(3), 0.0, -math.log(3)])
    expected = [math.log(4), math.log(2), math.log(4 / 3)]
    assert losses.reward(logits).tolist() == pytest.approx(expected, rel=1e-6)


def test_all_agree_with_the_slow_version_from_the_equations() -> None:
    torch.manual_seed(0)
    expert, other = torch.randn(7) * 3, torch.randn(9) * 3
    of_expert = sum(-math.log(sigmoid(x)) for x in expert.tolist()) / 7
    of_other = sum(-math.log(1 - sigmoid(x)) for x in other.tolist()) / 9
    loss = losses.discriminator_loss(expert, other)
    assert loss.item() == pytest.approx(of_expert + of_other, rel=1e-5)
    expected = [-math.log(1 - sigmoid(x)) for x in expert.tolist()]
    assert losses.reward(expert).tolist() == pytest.approx(expected, rel=1e-4)


def test_sure_discriminators_stay_finite_and_low_precision_is_summed_in_float32() -> None:
    sure = torch.tensor([-500.0, 500.0]).bfloat16()
    loss = losses.discriminator_loss(sure, sure)
    assert loss.dtype == torch.float32
    assert loss.item() == pytest.approx(500.0)
    assert torch.isfinite(losses.reward(sure)).all()
