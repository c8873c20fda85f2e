"""BootIfOL with a frozen backbone (Eff-BootIfOL): it learns from features, and the backbone from nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from dot_videos import FRAMES, SIZE, DotVideos
from transformers import EfficientNetModel

from bootifol.errors import BootifolError
from bootifol.networks.backbones import Backbone, load_backbone
from bootifol.presets import BACKBONE, PAPER
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.rewards.config import RewardConfig
from bootifol.rewards.registry import make_backbone
from bootifol.types import FeatureBatch, Video


class WithFeatures(DotVideos):
    """The same videos with features, computed once."""

    def __init__(self, name: str, jumps: bool, backbone: Backbone) -> None:
        super().__init__(name, jumps)
        self.features = np.stack([backbone.features(video) for video in self.videos])

    def __getitem__(self, index: int) -> Video:
        return replace(super().__getitem__(index), features=self.features[index])

    def sample_features(self, count: int, rng: np.random.Generator) -> FeatureBatch:
        return self.features[rng.choice(len(self.videos), count, replace=False)]


@pytest.fixture
def config(tiny_backbone: str) -> BootifolConfig:
    return BootifolConfig(backbone=tiny_backbone, videos_per_class=3, learning_rate=1e-3)


@pytest.fixture
def expert(config: BootifolConfig) -> WithFeatures:
    assert config.backbone is not None
    return WithFeatures("expert", False, load_backbone(config.backbone, SIZE))


@pytest.fixture
def other(config: BootifolConfig) -> WithFeatures:
    assert config.backbone is not None
    return WithFeatures("other", True, load_backbone(config.backbone, SIZE))


def learn(
    model: BootifolRewardModel, steps: int, expert: DotVideos, other: DotVideos
) -> list[dict[str, float]]:
    alignment = model.align(expert, other)
    return [dict(next(alignment)) for _ in range(steps)]


def test_it_learns_without_the_losses_of_pixels(
    config: BootifolConfig, expert: WithFeatures, other: WithFeatures
) -> None:
    model = BootifolRewardModel(replace(config, motion=True), SIZE, seed=1)
    history = learn(model, 25, expert, other)
    losses = {"loss/triplet", "loss/prediction", "loss/sequence", "loss/total"}
    assert set(history[0]) == {*losses, "distance/expert_other"}
    last = np.mean([metrics["loss/sequence"] for metrics in history[-10:]])
    assert last < 0.5 * history[0]["loss/sequence"]
    summed = history[0]["loss/triplet"] + history[0]["loss/prediction"] + history[0]["loss/sequence"]
    assert history[0]["loss/total"] == pytest.approx(summed, rel=1e-5)


def test_no_gradient_reaches_the_backbone(
    config: BootifolConfig, expert: WithFeatures, other: WithFeatures
) -> None:
    model = BootifolRewardModel(config, SIZE, seed=1)
    assert model.backbone is not None
    before = {name: value.clone() for name, value in model.backbone._network.state_dict().items()}
    learn(model, 2, expert, other)
    model.label(other[0], [expert[0]])
    for name, value in model.backbone._network.state_dict().items():
        assert torch.equal(value, before[name]), name
    assert all(parameter.grad is None for parameter in model.backbone._network.parameters())
    own = {name for name, _ in model.networks.named_parameters()}
    assert {name.split(".")[0] for name in own} == {"frame_encoder", "sequence_encoder", "state_predictor"}
    shapes = [list(layer.shape) for layer in model.networks.frame_encoder.parameters()]
    assert shapes == [[512, 32], [512], [128, 512], [128]]


def test_gradient_steps_and_labels_compute_no_features_that_are_there(
    config: BootifolConfig, expert: WithFeatures, other: WithFeatures, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = BootifolRewardModel(config, SIZE, seed=1)
    assert model.backbone is not None
    passes: list[int] = []
    compute = model.backbone._pass
    monkeypatch.setattr(model.backbone, "_pass", lambda frames: passes.append(len(frames)) or compute(frames))
    learn(model, 2, expert, other)
    known = model.label(other[0], [expert[0]])
    assert passes == []
    plain = Video("plain", other[0].frames)
    np.testing.assert_allclose(model.label(plain, [expert[0]]), known, rtol=1e-4, atol=1e-6)
    assert passes == [FRAMES]


def test_future_frames_leave_past_rewards_untouched(
    config: BootifolConfig, expert: WithFeatures, other: WithFeatures
) -> None:
    model = BootifolRewardModel(config, SIZE, seed=1)
    learn(model, 2, expert, other)
    before = model.label(Video("plain", other[0].frames), [expert[0]])
    assert before.shape == (FRAMES - 1,) and before.dtype == np.float32
    for changed in (1, 6, FRAMES - 1):
        frames = other[0].frames.copy()
        frames[changed] = 255 - frames[changed]
        after = model.label(Video("changed", frames), [expert[0]])
        np.testing.assert_array_equal(after[: changed - 1], before[: changed - 1])
        assert after[changed - 1] != before[changed - 1]


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_resumed_training_is_bit_for_bit_the_uninterrupted_one(
    config: BootifolConfig, expert: WithFeatures, other: WithFeatures, precision: str
) -> None:
    config = replace(config, precision=precision, motion=True)  # type: ignore[arg-type]
    straight, stopped, resumed = (BootifolRewardModel(config, SIZE, seed) for seed in (0, 0, 9))
    learn(straight, 4, expert, other)
    learn(stopped, 2, expert, other)
    resumed.load_state({name: array.copy() for name, array in stopped.state().items()})
    learn(resumed, 2, expert, other)
    one, same = straight.state(), resumed.state()
    assert one.keys() == same.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], same[name], err_msg=name)


def test_a_state_learned_from_other_features_is_refused(config: BootifolConfig, tmp_path: Path) -> None:
    model = EfficientNetModel.from_pretrained(str(config.backbone))
    with torch.no_grad():
        next(model.parameters()).view(-1)[0] += 1e-3
    model.save_pretrained(tmp_path / "other")
    other = BootifolRewardModel(replace(config, backbone=str(tmp_path / "other")), SIZE, seed=0)
    with pytest.raises(BootifolError, match="learned from features of other weights"):
        other.load_state(BootifolRewardModel(config, SIZE, seed=0).state())
    pixels = BootifolRewardModel(replace(config, backbone=None, width_divisor=32), SIZE, seed=0)
    with pytest.raises(BootifolError, match="does not fit its configuration"):
        other.load_state(pixels.state())


def test_videos_without_features_are_refused(config: BootifolConfig, expert: WithFeatures) -> None:
    model = BootifolRewardModel(config, SIZE, seed=0)
    with pytest.raises(
        BootifolError, match=r"wrap a demo set in bootifol\.demos\.features\.FeaturizedVideos"
    ):
        learn(model, 1, expert, DotVideos("plain", jumps=True))


def test_other_methods_read_pixels(config: BootifolConfig) -> None:
    rewards = RewardConfig(config)
    backbone = make_backbone("bootifol", rewards, SIZE)
    assert backbone is BootifolRewardModel(config, SIZE, seed=0).backbone  # loaded once
    assert make_backbone("virl", rewards, SIZE) is None
    assert make_backbone("bootifol", PAPER.reward, SIZE) is None


def test_the_preset_is_the_papers() -> None:
    assert BACKBONE.reward.bootifol == replace(PAPER.reward.bootifol, backbone="google/efficientnet-b0")
    assert (BACKBONE.pictures.video_size, BACKBONE.episode_steps) == (224, 50)
    assert BACKBONE.interactive == replace(PAPER.interactive, agent_videos=1500)
    assert BACKBONE.agent == PAPER.agent
