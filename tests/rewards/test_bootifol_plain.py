"""The whole model beside the plain one that benchmarks time: the same weights and draws, the same L and rewards."""

from __future__ import annotations

import numpy as np
import torch
from benchmarks.plain.bootifol import Choices, PlainBootifol

from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.rewards.bootifol.sampling import draw
from bootifol.types import Video

CONFIG = BootifolConfig(width_divisor=16, videos_per_class=3)


def twins() -> tuple[BootifolRewardModel, PlainBootifol]:
    model, plain = BootifolRewardModel(CONFIG, 64, seed=0), PlainBootifol(CONFIG.width_divisor)
    with torch.no_grad():
        for own, other in zip(plain.networks.parameters(), model.networks.parameters(), strict=True):
            own.copy_(other.reshape(own.shape))
    return model, plain


def test_the_loss_of_a_gradient_step_is_the_plain_one() -> None:
    model, plain = twins()
    videos = np.random.default_rng(0).integers(0, 256, (6, 12, 64, 64, 3), dtype=np.uint8)
    drawn = draw(CONFIG, 6, 12, np.random.default_rng(1))
    total, terms, _ = model._losses(videos[:, drawn.kept], drawn)
    choices = Choices(drawn.kept, drawn.positives, drawn.negatives, drawn.start)
    theirs = plain.loss(videos[:3], videos[3:], choices)
    assert len(terms) == 5
    torch.testing.assert_close(total, theirs, rtol=1e-4, atol=1e-4)
    total.backward()
    theirs.backward()
    for own, other in zip(model.networks.parameters(), plain.networks.parameters(), strict=True):
        assert own.grad is not None and other.grad is not None
        apart = (own.grad.reshape(other.shape) - other.grad).norm()
        assert apart < 0.01 * other.grad.norm() + 1e-4, (float(apart), float(other.grad.norm()))


def test_rewards_are_the_plain_ones() -> None:
    model, plain = twins()
    videos = np.random.default_rng(0).integers(0, 256, (2, 9, 64, 64, 3), dtype=np.uint8)
    rewards = model.label(Video("own", videos[0]), [Video("expert", videos[1])])
    torch.testing.assert_close(
        torch.from_numpy(rewards), plain.label(videos[0], videos[1]), rtol=1e-4, atol=1e-5
    )


def test_the_plain_one_draws_what_the_paper_says_and_learns() -> None:
    plain = PlainBootifol(divisor=32)
    choices = plain.draw(2, 30)
    own = np.arange(len(choices.kept))
    assert (np.abs(choices.positives - own) <= 2).all() and (choices.positives != own).all()
    assert (np.abs(choices.negatives - own) > 2).all()
    videos = np.random.default_rng(0).integers(0, 256, (4, 12, 64, 64, 3), dtype=np.uint8)
    before = [plain.alignment_step(videos[:2], videos[2:]) for _ in range(8)]
    assert before[-1] < before[0]
