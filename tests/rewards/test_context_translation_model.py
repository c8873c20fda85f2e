from dataclasses import replace

import numpy as np
import pytest
import torch
from dot_videos import DotVideos

from bootifol.errors import BootifolError
from bootifol.rewards.context_translation.config import ContextTranslationConfig
from bootifol.rewards.context_translation.model import ContextTranslationRewardModel
from bootifol.types import FrameBatch, Video

SIZE = 16
FRAMES = 8
SMALL = ContextTranslationConfig(
    references=4, width_divisor=32, pairs=3, frames_per_pair=2, learning_rate=3e-3
)


EXPERT = DotVideos("expert", jumps=False, count=24, size=SIZE, frames=FRAMES)
OTHER = DotVideos("other", jumps=True, count=24, size=SIZE, frames=FRAMES, seed=8)
REFERENCES = [EXPERT[i] for i in range(4)]


class Unread:
    """Videos that nobody may read."""

    def __len__(self) -> int:
        raise AssertionError("read")

    def __getitem__(self, index: int) -> Video:
        raise AssertionError("read")

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        raise AssertionError("read")


def make(config: ContextTranslationConfig = SMALL, seed: int = 0) -> ContextTranslationRewardModel:
    return ContextTranslationRewardModel(config, SIZE, seed)


def aligned(steps: int, config: ContextTranslationConfig = SMALL) -> ContextTranslationRewardModel:
    model = make(config)
    steps_of = model.align(EXPERT, Unread())
    for _ in range(steps):
        next(steps_of)
    return model


def test_it_learns_to_prefer_expert_videos() -> None:
    config = replace(SMALL, width_divisor=16, pairs=8, frames_per_pair=4, reward_unit="expert")
    model = make(config, seed=1)

    def rewards(source: DotVideos) -> np.ndarray:
        return np.array([model.label(source[i], REFERENCES).mean() for i in range(4, 12)])

    def preferred() -> float:
        return float((rewards(EXPERT)[:, None] > rewards(OTHER)).mean())

    assert preferred() < 0.9  # what is checked below is learned, not given
    steps = model.align(EXPERT, Unread())
    history = [next(steps) for _ in range(40)]
    assert set(history[0]) == {
        *("loss/translation", "loss/reconstruction", "loss/alignment", "loss/total", "cost/expert")
    }
    for name in ("translation", "reconstruction", "total"):
        assert history[-1][f"loss/{name}"] < 0.3 * history[0][f"loss/{name}"]
    assert preferred() > 0.9
    assert -2 < rewards(EXPERT).mean() < -0.4  # in units of what an expert frame costs


def test_total_is_the_weighted_sum_and_a_zero_weight_leaves_a_loss_out() -> None:
    weighted = replace(SMALL, reconstruction_weight=0.5, alignment_weight=3.0)
    metrics = next(make(weighted).align(EXPERT, Unread()))
    expected = metrics["loss/translation"] + 0.5 * metrics["loss/reconstruction"]
    assert metrics["loss/total"] == pytest.approx(expected + 3 * metrics["loss/alignment"], rel=1e-5)
    alone = next(make(replace(weighted, reconstruction_weight=0, alignment_weight=0)).align(EXPERT, Unread()))
    assert "loss/reconstruction" not in alone
    assert alone["loss/total"] == pytest.approx(metrics["loss/translation"], rel=1e-5)


def test_the_losses_are_those_of_the_equations_frame_by_frame() -> None:
    model = make()
    source, target = EXPERT.videos[:3], EXPERT.videos[3:6]
    moments = np.array([[1, 4], [0, 7], [2, 2]])
    with torch.no_grad():
        _, metrics = model._losses(source, target, moments)
        terms: dict[str, list[float]] = {"translation": [], "reconstruction": [], "alignment": []}
        for i, j, of_pair in zip(source, target, moments, strict=True):
            for t in of_pair:
                shown, wanted = picture(i[t]), picture(j[t])
                context, skips = model.networks.context_encoder(picture(j[0]))
                features = model.networks.frame_encoder(wanted)[0]
                translated = model.networks.translator(model.networks.frame_encoder(shown)[0], context)
                drawn = model.networks.decoder(translated, skips)
                redrawn = model.networks.decoder(features, skips)
                terms["translation"].append(float(((drawn - wanted) ** 2).mean()))
                terms["reconstruction"].append(float(((redrawn - wanted) ** 2).mean()))
                terms["alignment"].append(float(((translated - features) ** 2).mean()))
    for name, values in terms.items():
        assert metrics[f"loss/{name}"] == pytest.approx(np.mean(values), rel=1e-4)


def picture(frame: np.ndarray) -> torch.Tensor:
    """`[H, W, 3]` to `[1, 3, H, W]` in [-1, 1]."""
    return torch.from_numpy((frame / 127.5 - 1).astype(np.float32).transpose(2, 0, 1))[None]


@pytest.mark.parametrize("image_weight", [0.0, 0.2])
@pytest.mark.parametrize("count", [1, 3])
def test_label_is_minus_the_cost_of_each_frame(image_weight: float, count: int) -> None:
    model = aligned(3, replace(SMALL, image_weight=image_weight))
    video = OTHER[0]
    rewards = model.label(video, REFERENCES[:count])
    assert rewards.dtype == np.float32 and rewards.shape == (FRAMES - 1,)
    networks = model.networks
    with torch.no_grad():
        context, skips = networks.context_encoder(picture(video.frames[0]))
        for t in range(1, FRAMES):
            translated = [
                networks.translator(networks.frame_encoder(picture(shown.frames[t]))[0], context)
                for shown in REFERENCES[:count]
            ]
            features = networks.frame_encoder(picture(video.frames[t]))[0]
            cost = ((features - sum(translated) / count) ** 2).sum()
            drawn = sum(networks.decoder(one, skips) for one in translated) / count
            cost = cost + image_weight * ((picture(video.frames[t]) - drawn) ** 2).sum()
            assert rewards[t - 1] == pytest.approx(-float(cost), rel=1e-4)


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_a_frame_changes_its_own_reward_alone(precision: str) -> None:
    """So none of the past, which is what `label` promises; frame 0 is the context of all."""
    model = aligned(2, replace(SMALL, precision=precision))
    before = model.label(OTHER[0], REFERENCES)
    for changed in (0, 1, 4, FRAMES - 1):
        frames = OTHER[0].frames.copy()
        frames[changed] = 255 - frames[changed]
        differs = model.label(Video("changed", frames), REFERENCES) != before
        expected = np.arange(1, FRAMES) == changed if changed else np.ones(FRAMES - 1, bool)
        np.testing.assert_array_equal(differs, expected)


def test_updating_changes_nothing() -> None:
    model = aligned(2)
    before = model.state()
    assert model.update(Unread(), Unread()) == {}
    assert model.version == 2
    after = model.state()
    assert all(np.array_equal(before[name], after[name]) for name in before)


def test_the_unit_is_a_constant_after_the_alignment_phase() -> None:
    plain = aligned(3)
    scaled = aligned(3, replace(SMALL, reward_unit="expert"))
    ratio = plain.label(OTHER[0], REFERENCES) / scaled.label(OTHER[0], REFERENCES)
    np.testing.assert_allclose(ratio, scaled.state()["expert_cost"][0], rtol=1e-4)
    unaligned = make(replace(SMALL, reward_unit="expert")).label(OTHER[0], REFERENCES)
    np.testing.assert_array_equal(unaligned, make().label(OTHER[0], REFERENCES))


def test_pictures_that_cannot_be_halved_four_times_are_refused() -> None:
    with pytest.raises(BootifolError, match=r"cannot read 40x40 videos.*multiple of 16"):
        ContextTranslationRewardModel(SMALL, 40, 0)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("references", 0),
        ("image_weight", -1.0),
        ("reconstruction_weight", float("nan")),
        ("alignment_weight", -0.1),
        ("pairs", 0),
        ("frames_per_pair", 0),
        ("width_divisor", 0),
        ("width_divisor", 64),
        ("learning_rate", 0.0),
    ],
)
def test_bad_configurations_are_refused_with_a_sentence(field: str, value: float) -> None:
    with pytest.raises(BootifolError, match=rf"reward\.context_translation\.{field}"):
        replace(ContextTranslationConfig(), **{field: value})


def test_the_defaults_are_the_papers() -> None:
    config = ContextTranslationConfig()
    networks = ContextTranslationRewardModel(replace(config, width_divisor=1), SIZE, 0).networks
    assert [layer.out_channels for layer in networks.frame_encoder.strided] == [64, 128, 256, 512]
    assert [layer.out_channels for layer in networks.decoder.strided] == [256, 128, 64, 3]
    assert networks.translator.layers[0].out_features == networks.frame_encoder.output.out_features == 1024
    assert (config.references, config.image_weight, config.learning_rate) == (10, 1.0, 1e-4)
    # The release: half the summed squares over 48x48 pictures, 1000 times the mean over features, batches of 100.
    assert config.alignment_weight == pytest.approx(1000 / (0.5 * 100 * 48 * 48 * 3), rel=0.01)
