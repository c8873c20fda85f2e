from dataclasses import replace

import numpy as np
import pytest
import torch
from dot_videos import FRAMES, SIZE, DotVideos

from bootifol.errors import BootifolError
from bootifol.rewards.virl import sampling
from bootifol.rewards.virl.config import VirlConfig
from bootifol.rewards.virl.model import VirlRewardModel
from bootifol.rewards.virl.networks import SequenceDecoder

SMALL = VirlConfig(width_divisor=32, videos_per_class=3, learning_rate=1e-3, frames_per_video=4)
EXPERT = DotVideos("expert", jumps=False)
OTHER = DotVideos("other", jumps=True)

LEARNING = replace(
    SMALL,
    videos_per_class=4,
    frames_per_video=1,
    sequence_reconstruction_weight=0.0,
)


@pytest.fixture
def whole_videos(monkeypatch: pytest.MonkeyPatch) -> None:
    """No frame is left out."""
    monkeypatch.setattr(sampling, "_kept", lambda frames, rng: np.arange(frames))


def make(config: VirlConfig = SMALL, seed: int = 0, size: int = SIZE) -> VirlRewardModel:
    return VirlRewardModel(config, size, seed)


def trained(steps: int, config: VirlConfig = SMALL) -> VirlRewardModel:
    model = make(config)
    for _ in range(steps):
        model.update(EXPERT, OTHER)
    return model


def test_it_learns_while_the_agent_acts_and_only_then(
    whole_videos: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few altered copies and whole videos: expert and agent differ in how they move alone, and 50 steps must do."""
    monkeypatch.setattr(sampling, "ALTERED_FRACTION", 0.2)
    model = make(LEARNING)
    before = model.state()
    assert list(model.align(EXPERT, OTHER)) == []
    assert all(np.array_equal(before[name], array) for name, array in model.state().items())
    history = [model.update(EXPERT, OTHER) for _ in range(50)]
    last = {name: float(np.mean([metrics[name] for metrics in history[-10:]])) for name in history[0]}
    assert last["loss/sequence_triplet"] < 0.5 * history[0]["loss/sequence_triplet"]
    assert last["distance/negative"] > 3 * last["distance/positive"]
    expert, other = (
        np.stack([model.label(source[i], [EXPERT[7]]) for i in range(4)]) for source in (EXPERT, OTHER)
    )
    assert expert.sum(1).mean() > other.sum(1).mean()
    assert expert[:, -1].mean() > 0.75 * other[:, -1].mean()


def test_both_reconstructions_get_better() -> None:
    model = make()
    history = [model.update(EXPERT, OTHER) for _ in range(16)]
    assert set(history[0]) == {
        "loss/sequence_triplet",
        "loss/frame_triplet",
        "loss/sequence_reconstruction",
        "loss/frame_reconstruction",
        "loss/total",
        "distance/expert_agent",
        "distance/positive",
        "distance/negative",
    }
    for name in ("loss/frame_reconstruction", "loss/sequence_reconstruction"):
        assert history[-1][name] < 0.6 * history[0][name]


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_total_is_the_weighted_sum_and_zero_weights_leave_the_decoders_out(precision: str) -> None:
    metrics = make(replace(SMALL, precision=precision)).update(EXPERT, OTHER)
    expected = 0.7 * metrics["loss/sequence_triplet"] + 0.1 * metrics["loss/frame_triplet"]
    expected += 0.1 * metrics["loss/sequence_reconstruction"] + 0.1 * metrics["loss/frame_reconstruction"]
    assert metrics["loss/total"] == pytest.approx(expected, rel=1e-5)
    without = make(replace(SMALL, sequence_reconstruction_weight=0.0, frame_reconstruction_weight=0.0))
    assert "loss/sequence_reconstruction" not in without.update(EXPERT, OTHER)


def test_losses_are_those_of_videos_encoded_one_by_one(
    whole_videos: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With pairs by class alone, everything can be recomputed from the videos themselves."""
    monkeypatch.setattr(sampling, "ALTERED_FRACTION", 0.0)
    config = replace(SMALL, frames_per_video=None)
    model = make(config)
    n = config.videos_per_class

    class Fixed(DotVideos):
        def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
            return self.videos[:count]

    expert, agent = Fixed("expert", False), Fixed("agent", True)
    networks = make(config).networks
    pictures = torch.from_numpy(np.concatenate([expert.videos[:n], agent.videos[:n]])).permute(0, 1, 4, 2, 3)
    with torch.no_grad():
        e = networks.encode_frames(pictures.flatten(0, 1) / 255).unflatten(0, (2 * n, FRAMES))
        h = torch.stack([networks.encode_sequences(video[None])[0] for video in e])
        unrolled = networks.sequence_decoder(h[:, -1], FRAMES)
        decoded = [networks.frame_decoder(states.flatten(0, 1)) for states in (e, unrolled)]
    targets = pictures.flatten(0, 1) / 255
    total_h, total_e = 0.0, 0.0
    for i in range(2 * n):
        same = (i + 1) % n + (i // n) * n
        across = (i + n) % (2 * n)
        total_h += float(
            (h[i, -1] - h[same, -1]).norm() + (1 - (h[i, -1] - h[across, -1]).norm()).clamp(min=0)
        )
        for t in range(FRAMES):
            total_e += float(
                (e[i, t] - e[same, t]).norm() + (1 - (e[i, t] - e[across, t]).norm()).clamp(min=0)
            )
    metrics = model.update(expert, agent)
    assert metrics["loss/sequence_triplet"] == pytest.approx(total_h / (2 * n), rel=1e-4)
    assert metrics["loss/frame_triplet"] == pytest.approx(total_e / (2 * n * FRAMES), rel=1e-4)
    # Counted twice: for the anchor and for the positive of Eq. (4).
    squares = [2 * float((picture - targets).square().mean()) for picture in decoded]
    assert metrics["loss/frame_reconstruction"] == pytest.approx(squares[0], rel=1e-4)
    assert metrics["loss/sequence_reconstruction"] == pytest.approx(squares[1], rel=1e-4)


def test_noisy_copies_have_noise(whole_videos: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "ALTERED_FRACTION", 1.0)
    monkeypatch.setattr("bootifol.rewards.virl.model.NOISE", 0.1)
    model = make()
    encoded: list[torch.Tensor] = []
    encode = model.networks.encode_frames
    monkeypatch.setattr(
        model.networks, "encode_frames", lambda pictures: encoded.append(pictures) or encode(pictures)
    )
    model.update(EXPERT, OTHER)
    originals, copies = encoded[0].unflatten(0, (-1, FRAMES)).split([6, len(encoded[0]) // FRAMES - 6])
    assert len(copies) > 0
    for copy in copies:
        noise = min((copy - original for original in originals), key=torch.Tensor.norm)
        assert float(noise.std()) == pytest.approx(0.1, rel=0.05)
        assert abs(float(noise.mean())) < 0.005


def test_the_sequence_decoder_feeds_its_output_back() -> None:
    torch.manual_seed(0)
    decoder = SequenceDecoder()
    encoding = torch.rand(2, 128)
    unrolled = decoder(encoding, 3)
    first, memory = decoder.lstm(decoder.input(encoding)[:, None])
    second, _ = decoder.lstm(first, memory)
    torch.testing.assert_close(unrolled[:, 0], first[:, 0])
    torch.testing.assert_close(unrolled[:, 1], second[:, 0])


def test_label_is_minus_the_distance_of_the_encodings() -> None:
    model = trained(2)
    video, reference = OTHER[0], EXPERT[1]
    rewards = model.label(video, [reference])
    assert rewards.dtype == np.float32
    encodings = zip(model._encode(video), model._encode(reference), strict=True)
    frames, sequences = (np.linalg.norm(own - expert, axis=1)[1:] for own, expert in encodings)
    np.testing.assert_allclose(rewards, -(frames + sequences), rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(model.label(reference, [reference]), 0.0, atol=1e-5)


def test_several_references_are_averaged() -> None:
    single, several = trained(2), trained(2, replace(SMALL, references=3))
    assert several.reference_count == 3
    references = [EXPERT[i] for i in range(3)]
    each = np.stack([single.label(OTHER[0], [reference]) for reference in references])
    np.testing.assert_allclose(several.label(OTHER[0], references), each.mean(0), rtol=1e-5)


def test_references_are_encoded_once_for_each_version(monkeypatch: pytest.MonkeyPatch) -> None:
    model = trained(1)
    encoded: list[str] = []
    encode = model._encode
    monkeypatch.setattr(model, "_encode", lambda video: encoded.append(video.name) or encode(video))
    first = model.label(OTHER[0], [EXPERT[0]])
    np.testing.assert_array_equal(model.label(OTHER[0], [EXPERT[0]]), first)
    assert len(encoded) == 3
    model.update(EXPERT, OTHER)
    assert model.version == 2
    assert not np.array_equal(model.label(OTHER[0], [EXPERT[0]]), first)
    assert len(encoded) == 5


def test_videos_too_short_to_be_altered_are_refused() -> None:
    with pytest.raises(BootifolError, match="use longer videos"):
        make().update(DotVideos("short", False, 3, frames=3), OTHER)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("references", 0),
        ("sequence_triplet_weight", -1.0),
        ("frame_triplet_weight", float("nan")),
        ("sequence_reconstruction_weight", -0.1),
        ("frame_reconstruction_weight", -0.1),
        ("videos_per_class", 1),
        ("frames_per_video", 0),
        ("width_divisor", 0),
        ("width_divisor", 64),
        ("learning_rate", 0.0),
    ],
)
def test_bad_configurations_are_refused_with_a_sentence(field: str, value: float) -> None:
    with pytest.raises(BootifolError, match=rf"reward\.virl\.{field} must"):
        replace(VirlConfig(), **{field: value})


def test_a_model_without_triplets_is_refused() -> None:
    with pytest.raises(BootifolError, match="no distance would be learned"):
        VirlConfig(sequence_triplet_weight=0.0, frame_triplet_weight=0.0)
