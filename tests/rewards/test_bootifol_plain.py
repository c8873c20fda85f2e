"""The whole model beside the plain one that benchmarks time: the same weights and draws, the same L and rewards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from benchmarks.plain.alignment import sequence_loss
from benchmarks.plain.bootifol import Choices, PlainBootifol, pictures_of
from dot_videos import DotVideos

from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.rewards.bootifol.sampling import draw
from bootifol.rewards.bootifol.scale import DistanceScale
from bootifol.types import FrameBatch, Video

CONFIG = BootifolConfig(width_divisor=16, videos_per_class=3)


def twins(config: BootifolConfig = CONFIG) -> tuple[BootifolRewardModel, PlainBootifol]:
    model, plain = BootifolRewardModel(config, 64, seed=0), PlainBootifol(config.width_divisor)
    take_parameters(plain, model)
    return model, plain


def take_parameters(plain: PlainBootifol, model: BootifolRewardModel) -> None:
    with torch.no_grad():
        for own, other in zip(plain.networks.parameters(), model.networks.parameters(), strict=True):
            own.copy_(other.reshape(own.shape))


def plain_encodings(plain: PlainBootifol, videos: FrameBatch) -> torch.Tensor:
    """z `[B, T', 128]` of every prefix of videos `[B, T', 64, 64, 3]`, as in a gradient step."""
    with torch.no_grad():
        states = plain.encode_frames(pictures_of(videos.reshape(-1, *videos.shape[2:])))
        return plain.encode_sequence(states.reshape(*videos.shape[:2], -1))


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


def test_the_sequence_loss_at_several_times_is_the_mean_of_plain_ones() -> None:
    config = replace(CONFIG, sequence_times=4, frame_drop=0.0)
    model, plain = twins(config)
    videos = np.random.default_rng(0).integers(0, 256, (6, 12, 64, 64, 3), dtype=np.uint8)
    _, terms, _ = model._losses(videos, draw(config, 6, 12, np.random.default_rng(1)))
    expert, other = plain_encodings(plain, videos).chunk(2)
    expected = [float(sequence_loss(expert[:, t], other[:, t])) for t in (2, 5, 8, 11)]
    assert terms["loss/sequence"].item() == pytest.approx(np.mean(expected), rel=1e-4)
    assert max(expected) > 1.001 * min(expected)


class FirstVideos(DotVideos):
    """Whoever samples gets the first ones."""

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self.videos[:count]


def test_the_reward_scale_is_of_plain_distances() -> None:
    config = replace(CONFIG, reward_scale="alignment", frame_drop=0.2)
    model, plain = twins(config)
    expert, other = (FirstVideos(name, name == "other", size=64) for name in ("expert", "other"))
    steps, rng, scale = model.align(expert, other), np.random.default_rng(0), DistanceScale()
    for _ in range(2):
        take_parameters(plain, model)
        videos = np.concatenate([expert.videos[:3], other.videos[:3]])
        kept = draw(config, 6, 12, rng).kept
        assert len(kept) < 12
        ones, others = plain_encodings(plain, videos[:, kept]).chunk(2)
        distances = torch.linalg.vector_norm(ones - others, dim=2).mean(0)
        scale.observe(kept, distances.double().numpy())
        next(steps)
    np.testing.assert_allclose(model.state()["reward_scale"], scale.means, rtol=1e-3)

    unscaled = BootifolRewardModel(replace(config, reward_scale="none"), 64, seed=1)
    unscaled.load_state(model.state())
    negative_distances = torch.from_numpy(unscaled.label(other[0], [expert[0]]))
    rewards = model.label(other[0], [expert[0]])
    np.testing.assert_allclose(rewards, scale.rewards(negative_distances), rtol=1e-3, atol=1e-4)


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
