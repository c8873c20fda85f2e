"""What every reward model that learns must hold, whatever its method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from dot_videos import FRAMES, SIZE, DotVideos

from bootifol.errors import BootifolError
from bootifol.rewards.base import RewardModel
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.config import RewardConfig
from bootifol.rewards.context_translation.config import ContextTranslationConfig
from bootifol.rewards.gaifo.config import GaifoConfig
from bootifol.rewards.learned import LearnedRewardModel
from bootifol.rewards.registry import METHODS, make_reward_model
from bootifol.rewards.virl.config import VirlConfig
from bootifol.types import Arrays, Metrics, Rewards, Video

LEARNED = [method for method in METHODS if method != "environment"]
SMALL = RewardConfig(
    BootifolConfig(width_divisor=32, videos_per_class=3, frames_per_video=5, reward_scale="alignment"),
    VirlConfig(width_divisor=32, videos_per_class=3, frames_per_video=4),
    ContextTranslationConfig(
        width_divisor=32, pairs=3, frames_per_pair=2, references=3, reward_unit="expert"
    ),
    GaifoConfig(width_divisor=16, videos_per_class=8),
)
EXPERT = DotVideos("expert", jumps=False)
OTHER = DotVideos("other", jumps=True)

pytestmark = pytest.mark.parametrize("method", LEARNED)


def make(method: str, seed: int = 0, size: int = SIZE, **changed: object) -> RewardModel:
    config = replace(SMALL, **{method: replace(getattr(SMALL, method), **changed)})  # type: ignore[arg-type]
    return make_reward_model(method, config, size, seed)


def learn(model: RewardModel, steps: int, expert: DotVideos = EXPERT, other: DotVideos = OTHER) -> Metrics:
    """Gradient steps of the Alignment Phase, or of the Interactive Phase for a method that has nothing to align."""
    alignment = model.align(expert, other)
    metrics: Metrics = {}
    for _ in range(steps):
        metrics = next(alignment, {}) or model.update(expert, other)
    return metrics


def label(model: RewardModel, video: Video = OTHER[0], expert: DotVideos = EXPERT) -> Rewards:
    return model.label(video, [expert[index] for index in range(model.reference_count)])


def copied(arrays: Arrays) -> Arrays:
    return {name: array.copy() for name, array in arrays.items()}


def assert_same(one: Arrays, other: Arrays) -> None:
    assert one.keys() == other.keys()
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name], err_msg=name)


def test_steps_log_what_they_made_smaller(method: str) -> None:
    metrics = learn(make(method), 1)
    terms = [value for name, value in metrics.items() if name.startswith("loss/") and name != "loss/total"]
    assert terms and np.isfinite(list(metrics.values())).all()
    assert 0 < metrics["loss/total"] < sum(terms) + 1e-4  # no weight is above 1


def test_running_statistics_begin_at_those_of_the_first_gradient_step(method: str) -> None:
    model = make(method)
    assert isinstance(model, LearnedRewardModel)
    means = [buffer for name, buffer in model.networks.named_buffers() if name.endswith("running_mean")]
    if not means:
        assert method == "context_translation"  # which normalizes nothing
        return
    for mean in means:
        mean.fill_(1e6)
    learn(model, 1)
    assert all(mean.abs().max() < 100 for mean in means)
    learn(model, 20)
    assert {layer.momentum for layer in model.networks.modules() if hasattr(layer, "momentum")} == {0.1}


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_resumed_training_is_bit_for_bit_the_uninterrupted_one(method: str, precision: str) -> None:
    straight, stopped, resumed = (make(method, seed, precision=precision) for seed in (0, 0, 99))
    learn(straight, 4)
    learn(stopped, 2)
    resumed.load_state(copied(stopped.state()))
    learn(resumed, 2)
    assert resumed.version == straight.version == 4
    assert_same(resumed.state(), straight.state())
    np.testing.assert_array_equal(label(resumed), label(straight))


def test_loading_a_state_forgets_what_was_encoded_before(method: str) -> None:
    model, other = make(method), make(method, seed=1)
    learn(model, 1)
    learn(other, 1)
    label(model)
    model.load_state(copied(other.state()))
    np.testing.assert_array_equal(label(model), label(other))


def test_state_is_a_copy_and_seeds_decide_everything(method: str) -> None:
    model = make(method)
    learn(model, 1)
    state = model.state()
    copies = copied(state)
    learn(model, 1)
    assert_same(state, copies)
    torch.manual_seed(12345)  # whatever the global generator holds
    again = make(method)
    learn(again, 1)
    assert_same(again.state(), copies)
    zero, one = make(method).state(), make(method, seed=1).state()
    assert not all(np.array_equal(zero[name], one[name]) for name in zero if name.endswith("weight"))


def test_labeling_changes_nothing_but_learning_changes_labels(method: str) -> None:
    model = make(method)
    learn(model, 1)
    before = copied(model.state())
    first = label(model)
    assert first.dtype == np.float32 and first.shape == (FRAMES - 1,)
    np.testing.assert_array_equal(label(model), first)
    assert_same(model.state(), before)
    learn(model, 1)
    assert not np.array_equal(label(model), first)


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_future_frames_leave_past_rewards_untouched(method: str, precision: str) -> None:
    model = make(method, precision=precision, learning_rate=1e-3)
    learn(model, 2)
    before = label(model)
    for changed in (1, 6, FRAMES - 1):
        frames = OTHER[0].frames.copy()
        frames[changed] = 255 - frames[changed]
        after = label(model, Video("changed", frames))
        np.testing.assert_array_equal(after[: changed - 1], before[: changed - 1])
        assert after[changed - 1] != before[changed - 1]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_loss_that_is_not_finite_takes_no_step(method: str, bad: float) -> None:
    model = make(method)
    learn(model, 2)
    assert isinstance(model, LearnedRewardModel)
    with torch.no_grad():
        weight = next(model.networks.parameters())
        weight[(0,) * weight.ndim] = bad
    before = model.state()
    with pytest.raises(
        BootifolError, match=r"not a finite number at its gradient step 3.*learning_rate in the run"
    ):
        learn(model, 1)
    after = model.state()
    assert_same(*({name: state[name] for name in state if name != "random"} for state in (before, after)))


def test_videos_of_the_paper_size(method: str) -> None:
    expert, other = (DotVideos(name, name == "other", 8, 64, 6) for name in ("expert", "other"))
    model = make(method, size=64)
    learn(model, 1, expert, other)
    assert label(model, other[0], expert).shape == (5,)


def test_mistakes_are_refused_with_a_sentence(method: str) -> None:
    model = make(method)
    with pytest.raises(BootifolError, match="reads uint8 videos of 32x32 RGB frames"):
        label(model, Video("large", np.zeros((5, 64, 64, 3), np.uint8)))
    with pytest.raises(BootifolError, match="reads uint8 videos of 32x32 RGB frames"):
        learn(model, 1, expert=DotVideos("large", False, size=64))
    with pytest.raises(BootifolError, match="does not fit its configuration"):
        make(method, width_divisor=8).load_state(model.state())
    if model.reference_count:
        with pytest.raises(BootifolError, match=rf"with 1 to {model.reference_count} reference.*given 0"):
            model.label(OTHER[0], [])
        with pytest.raises(BootifolError, match="short has 5 frames, fewer than the 12 of other-0"):
            model.label(OTHER[0], [Video("short", EXPERT[0].frames[:5])])
