from dataclasses import replace

import numpy as np
import pytest
from dot_videos import SIZE, DotVideos

from bootifol.errors import BootifolError
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.model import BootifolRewardModel

SMALL = BootifolConfig(width_divisor=32, videos_per_class=3, learning_rate=1e-3)


EXPERT = DotVideos("expert", jumps=False)
OTHER = DotVideos("other", jumps=True)


def make(config: BootifolConfig = SMALL, seed: int = 0, size: int = SIZE) -> BootifolRewardModel:
    return BootifolRewardModel(config, size, seed)


def aligned(steps: int, config: BootifolConfig = SMALL) -> BootifolRewardModel:
    model = make(config)
    steps_of = model.align(EXPERT, OTHER)
    for _ in range(steps):
        next(steps_of)
    return model


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_alignment_lowers_the_loss_and_separates_the_classes(precision: str) -> None:
    model = make(replace(SMALL, precision=precision), seed=2)
    steps = model.align(EXPERT, OTHER)
    history = [next(steps) for _ in range(50)]
    first = history[0]
    last = {name: float(np.mean([metrics[name] for metrics in history[-15:]])) for name in first}
    assert set(first) == {
        "loss/multiview",
        "loss/triplet",
        "loss/autoencoder",
        "loss/prediction",
        "loss/sequence",
        "loss/total",
        "distance/expert_other",
    }
    assert last["loss/total"] < 0.8 * first["loss/total"]
    assert last["loss/sequence"] < 0.5 * first["loss/sequence"]
    reward = {
        source.name: float(np.mean([model.label(source[i], [EXPERT[7]]).sum() for i in range(4)]))
        for source in (EXPERT, OTHER)
    }
    assert reward["expert"] > reward["other"]


def test_total_is_the_weighted_sum_and_zero_weights_leave_losses_out() -> None:
    config = replace(SMALL, multiview_weight=0.25, triplet_weight=2.0, autoencoder_weight=0.0)
    metrics = next(make(config).align(EXPERT, OTHER))
    assert "loss/autoencoder" not in metrics
    expected = 0.25 * metrics["loss/multiview"] + 2 * metrics["loss/triplet"]
    expected += metrics["loss/prediction"] + metrics["loss/sequence"]
    assert metrics["loss/total"] == pytest.approx(expected, rel=1e-5)


def test_label_is_the_distance_of_prefix_encodings() -> None:
    model = aligned(2)
    video, reference = OTHER[0], EXPERT[1]
    rewards = model.label(video, [reference])
    assert rewards.dtype == np.float32
    difference = (model._encode(video) - model._encode(reference))[1:].numpy()
    np.testing.assert_allclose(rewards, -np.linalg.norm(difference, axis=1), rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(model.label(reference, [reference]), 0.0, atol=1e-5)


def test_cosine_reward() -> None:
    model = aligned(2, replace(SMALL, reward="cosine"))
    z, z_expert = (model._encode(video)[1:].numpy() for video in (OTHER[0], EXPERT[1]))
    cosine = (z * z_expert).sum(1) / np.linalg.norm(z, axis=1) / np.linalg.norm(z_expert, axis=1)
    np.testing.assert_allclose(model.label(OTHER[0], [EXPERT[1]]), cosine, rtol=1e-4)


def test_references_are_encoded_once_for_each_version_of_the_encoders(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model = aligned(1)
    encoded: list[str] = []
    encode = model._encode
    monkeypatch.setattr(model, "_encode", lambda video: encoded.append(video.name) or encode(video))
    model.label(OTHER[0], [EXPERT[0]])
    model.label(OTHER[1], [EXPERT[0]])
    model.label(OTHER[1], [EXPERT[1]])
    assert encoded == ["other-0", "expert-0", "other-1", "other-1", "expert-1"]
    old = model.label(OTHER[1], [EXPERT[0]])
    version = model.version
    model.update(EXPERT, OTHER)
    assert model.version == version + 1
    encoded.clear()
    assert not np.array_equal(model.label(OTHER[1], [EXPERT[0]]), old)
    assert encoded == ["other-1", "expert-0"]


def test_several_references_give_their_mean_at_every_time_step() -> None:
    single = aligned(2)
    several = aligned(2, replace(SMALL, references=3))
    assert several.reference_count == 3
    references = [EXPERT[i] for i in range(3)]
    each = np.stack([single.label(OTHER[0], [reference]) for reference in references])
    np.testing.assert_allclose(several.label(OTHER[0], references), each.mean(0), rtol=1e-3, atol=1e-6)


def test_alignment_scale_gives_random_episodes_about_zero_a_step() -> None:
    model = aligned(60, replace(SMALL, reward_scale="alignment"))
    rewards = [model.label(OTHER[i], [EXPERT[i]]).mean() for i in range(8)]
    # Labels normalize with running statistics and the scale with a batch's own, so it is not exact.
    assert -0.7 < np.mean(rewards) < 0.4
    scale = model.state()["reward_scale"].copy()
    model.update(EXPERT, OTHER)
    np.testing.assert_array_equal(model.state()["reward_scale"], scale)


def test_a_scale_without_alignment_comes_from_the_first_gradient_steps() -> None:
    model = aligned(0, replace(SMALL, reward_scale="alignment"))
    model.update(EXPERT, OTHER)
    first = model.state()["reward_scale"].copy()
    for _ in range(49):
        model.update(EXPERT, OTHER)
    settled = model.state()["reward_scale"].copy()
    assert not np.allclose(first[1:], settled[1:])
    model.update(EXPERT, OTHER)
    np.testing.assert_array_equal(model.state()["reward_scale"], settled)


def test_frames_per_video_leaves_the_sequence_losses_on_all_frames() -> None:
    few = next(make(replace(SMALL, frames_per_video=3, frame_drop=0.0)).align(EXPERT, OTHER))
    every = next(make(replace(SMALL, frame_drop=0.0)).align(EXPERT, OTHER))
    assert few["loss/sequence"] == pytest.approx(every["loss/sequence"], rel=1e-4)
    assert few["loss/multiview"] < every["loss/multiview"]  # fewer frames, fewer negatives


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("references", 0),
        ("temperature", 0.0),
        ("learning_rate", float("inf")),
        ("margin", float("nan")),
        ("triplet_weight", -1.0),
        ("videos_per_class", 1),
        ("frame_drop", 1.0),
        ("frames_per_video", 0),
        ("width_divisor", 0),
        ("width_divisor", 64),
    ],
)
def test_bad_configurations_are_refused_with_a_sentence(field: str, value: float) -> None:
    with pytest.raises(BootifolError, match=rf"reward\.bootifol\.{field} must"):
        replace(BootifolConfig(), **{field: value})


def test_scaled_cosine_is_refused() -> None:
    with pytest.raises(BootifolError, match="bootifol: reward_scale"):
        BootifolConfig(reward="cosine", reward_scale="alignment")
