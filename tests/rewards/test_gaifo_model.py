from dataclasses import replace

import numpy as np
import pytest
import torch
from dot_videos import FRAMES, SIZE, DotVideos

from bootifol.errors import BootifolError
from bootifol.rewards.gaifo import losses
from bootifol.rewards.gaifo.config import GaifoConfig
from bootifol.rewards.gaifo.model import GaifoRewardModel

SMALL = GaifoConfig(width_divisor=16, videos_per_class=8, stacks_per_video=4, learning_rate=3e-3)
EXPERT = DotVideos("expert", jumps=False, count=32)
OTHER = DotVideos("other", jumps=True, count=32)


def make(config: GaifoConfig = SMALL, seed: int = 0, size: int = SIZE) -> GaifoRewardModel:
    return GaifoRewardModel(config, size, seed)


def aligned(steps: int, config: GaifoConfig = SMALL, seed: int = 0) -> GaifoRewardModel:
    model = make(config, seed)
    steps_of = model.align(EXPERT, OTHER)
    for _ in range(steps):
        next(steps_of)
    return model


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_alignment_lowers_the_loss_and_puts_expert_above_other(precision: str) -> None:
    """On videos it has not seen; only the motion tells the classes apart."""
    model = make(replace(SMALL, precision=precision))
    steps = model.align(EXPERT, OTHER)
    history = [next(steps) for _ in range(40)]
    last = {name: float(np.mean([metrics[name] for metrics in history[-10:]])) for name in history[0]}
    assert 0.9 < history[0]["loss/discriminator"] < 2.0
    assert last["loss/discriminator"] < 0.4
    assert last["discriminator/accuracy"] > 0.9
    assert last["discriminator/expert"] > 0.75 > 0.25 > last["discriminator/other"]
    expert, other = (
        [float(model.label(source[i], []).mean()) for i in range(8)]
        for source in (DotVideos("new", False, seed=8), DotVideos("new", True, seed=8))
    )
    assert min(expert) > max(other)


def test_updates_learn_from_the_agents_videos_without_any_alignment() -> None:
    """The paper has no Alignment Phase."""
    model = make()
    for _ in range(20):
        metrics = model.update(EXPERT, OTHER)
    assert metrics["loss/discriminator"] < 0.8
    assert model.version == 20


def test_label_rewards_the_logit_of_the_stack_that_ends_at_the_next_frame() -> None:
    video = OTHER[0]
    model = aligned(3)
    model.networks.eval()
    expected = []
    for t in range(FRAMES - 1):
        stack = [video.frames[max(t - 1, 0)], video.frames[t], video.frames[t + 1]]
        channels = np.concatenate(stack, axis=2).transpose(2, 0, 1)[None] / np.float32(255)
        with torch.no_grad():
            logit = model.networks(torch.from_numpy(channels))
        expected.append(losses.reward(logit).item())
    model.networks.train()
    rewards = model.label(video, [])
    assert rewards.dtype == np.float32 and rewards.shape == (FRAMES - 1,)
    np.testing.assert_allclose(rewards, expected, rtol=1e-3, atol=1e-5)


def test_references_are_not_looked_at() -> None:
    model = aligned(2)
    assert model.reference_count == 0
    np.testing.assert_array_equal(model.label(OTHER[0], [EXPERT[0]]), model.label(OTHER[0], []))


def test_labels_do_not_depend_on_how_many_are_made_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    model = aligned(2)
    whole = model.label(OTHER[0], [])
    monkeypatch.setattr("bootifol.rewards.gaifo.model.LABEL_BATCH", 4)
    np.testing.assert_allclose(model.label(OTHER[0], []), whole, rtol=1e-4, atol=1e-6)


def test_the_shorter_class_sets_the_length() -> None:
    """Otherwise late frames, which only one class has, would tell the classes apart."""
    short, long = DotVideos("short", False, frames=4), DotVideos("long", True, frames=12)
    cut = DotVideos("cut", True, frames=12)
    cut.videos = long.videos[:, :4]
    one, two = make(), make()
    assert one.update(short, long) == two.update(short, cut)


def test_the_defaults_are_those_of_the_public_image_version() -> None:
    """medric49/gaifo, its configuration and networks; stacks of 3 as the paper."""
    config = GaifoConfig()
    assert config.videos_per_class * config.stacks_per_video == 256
    assert config.learning_rate == 1e-4
    weights = {name: tuple(array.shape) for name, array in make(config, size=64).state().items()}
    convolutions = [weights[f"network/strided.{layer}.weight"] for layer in (0, 3, 6, 9)]
    assert convolutions == [(64, 9, 5, 5), (128, 64, 5, 5), (256, 128, 5, 5), (512, 256, 5, 5)]
    linear = [weights[f"network/pointwise.{layer}.weight"] for layer in (0, 3, 6, 9)]
    assert linear == [(512, 512), (128, 512), (32, 128), (1, 32)]


def test_mistakes_are_refused_with_a_sentence() -> None:
    with pytest.raises(BootifolError, match=r"have one frame.*use longer videos"):
        next(make().align(DotVideos("still", False, frames=1), OTHER))
    with pytest.raises(BootifolError, match="cannot read 50x50 videos"):
        make(size=50)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("videos_per_class", 0),
        ("stacks_per_video", 0),
        ("width_divisor", 0),
        ("width_divisor", 64),
        ("learning_rate", 0.0),
        ("precision", "fp8"),
    ],
)
def test_bad_configurations_are_refused_with_a_sentence(field: str, value: object) -> None:
    with pytest.raises(BootifolError, match=rf"reward\.gaifo\.{field} must"):
        replace(GaifoConfig(), **{field: value})
