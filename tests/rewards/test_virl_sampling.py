from dataclasses import replace

import numpy as np
import pytest

from bootifol.errors import BootifolError
from bootifol.rewards.virl import sampling
from bootifol.rewards.virl.config import VirlConfig
from bootifol.rewards.virl.sampling import FEWEST_FRAMES, draw, nearly_in_order, out_of_order

CONFIG = VirlConfig(videos_per_class=3)
RNG = np.random.default_rng(0)


@pytest.fixture
def whole_videos(monkeypatch: pytest.MonkeyPatch) -> None:
    """No frame is left out."""
    monkeypatch.setattr(sampling, "_kept", lambda frames, rng: np.arange(frames))


def test_pairs_by_class_are_in_time_and_of_the_right_class(
    whole_videos: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sampling, "ALTERED_FRACTION", 0.0)
    drawn = draw(CONFIG, 20, RNG)
    assert len(drawn.noisy) == 0
    np.testing.assert_array_equal(drawn.positive[0], [1, 2, 0, 4, 5, 3])
    np.testing.assert_array_equal(drawn.negative[0], [3, 4, 5, 0, 1, 2])
    for order in (drawn.positive[1], drawn.negative[1]):
        np.testing.assert_array_equal(order, np.tile(np.arange(20), (6, 1)))


def test_altered_pairs_are_copies_of_their_anchor(
    whole_videos: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sampling, "ALTERED_FRACTION", 1.0)
    for _ in range(20):
        drawn = draw(CONFIG, 20, RNG)
        originals = np.concatenate([np.arange(6), drawn.noisy])
        np.testing.assert_array_equal(originals[drawn.positive[0]], np.arange(6))
        np.testing.assert_array_equal(drawn.negative[0], np.arange(6))
        noisy = drawn.positive[0] >= 6
        np.testing.assert_array_equal(drawn.positive[1][noisy], np.tile(np.arange(20), (noisy.sum(), 1)))
        moved = (drawn.positive[1][~noisy] != np.arange(20)).any(1)
        assert moved.all()


@pytest.mark.parametrize("length", [FEWEST_FRAMES, 61])
def test_positives_keep_nearly_every_frame_and_negatives_do_not(length: int) -> None:
    time = np.arange(length)
    for _ in range(30):
        for swap in (True, False):
            order = nearly_in_order(length, swap, RNG)
            assert 1 <= (order != time).sum() <= max(2, 0.2 * length + 1)
            if swap:
                np.testing.assert_array_equal(np.sort(order), time)
    negatives = [out_of_order(length, RNG) for _ in range(60)]
    assert np.mean([(order != time).mean() for order in negatives]) > 0.5
    assert any((order == time[::-1]).all() for order in negatives)
    assert any(order[0] > 0 and order[-1] == order[-2] == length - 1 for order in negatives)


def test_early_ends_are_more_frequent_and_every_end_is_met(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "FRAME_DROP", 0.0)
    lengths = np.array([len(draw(CONFIG, 12, RNG).kept) for _ in range(600)])
    counts = np.bincount(lengths, minlength=13)[FEWEST_FRAMES:]
    assert (counts > 0).all()
    # p ~ 9, 8 … 1 over lengths 4 … 12
    np.testing.assert_allclose(counts / 600, np.arange(9, 0, -1) / 45, atol=0.06)


def test_frames_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "FRAME_DROP", 0.3)
    kept = [draw(CONFIG, 40, RNG).kept for _ in range(200)]
    assert np.mean([len(of_one) / (of_one[-1] + 1) for of_one in kept if len(of_one) > 8]) < 0.8


def test_decoded_frames(whole_videos: None) -> None:
    drawn = draw(replace(CONFIG, frames_per_video=4), 40, RNG)
    assert drawn.decoded.shape == (6, 4)
    assert (np.diff(drawn.decoded, axis=1) > 0).all()
    assert drawn.decoded.max() < len(drawn.kept)
    every = draw(CONFIG, 10, RNG)
    np.testing.assert_array_equal(every.decoded, np.tile(np.arange(10), (6, 1)))


def test_too_short_videos_are_refused() -> None:
    with pytest.raises(
        BootifolError, match=r"3 frames, but the reward model needs at least 4.*longer videos"
    ):
        draw(CONFIG, 3, RNG)
