import numpy as np
import pytest

from bootifol.errors import BootifolError
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.sampling import draw


def test_positives_are_within_the_window_and_negatives_outside() -> None:
    config = BootifolConfig(window=2, frame_drop=0.0)
    seen_positive, seen_negative = set(), set()
    rng = np.random.default_rng(0)
    for _ in range(50):
        drawn = draw(config, videos=3, frames=9, rng=rng)
        near = np.abs(drawn.positives - drawn.anchors)
        far = np.abs(drawn.negatives - drawn.anchors)
        assert ((near >= 1) & (near <= 2)).all()
        assert (far > 2).all()
        assert drawn.positives.min() >= 0 and drawn.positives.max() <= 8
        assert drawn.negatives.min() >= 0 and drawn.negatives.max() <= 8
        np.testing.assert_array_equal(drawn.anchors, np.tile(np.arange(9), (3, 1)))
        seen_positive |= set(drawn.positives[:, 4])
        seen_negative |= set(drawn.negatives[:, 4])
    assert seen_positive == {2, 3, 5, 6}
    assert seen_negative == {0, 1, 7, 8}


def test_starts_range_from_5_to_t_minus_k() -> None:
    config = BootifolConfig(predicted_states=2, frame_drop=0.0)
    rng = np.random.default_rng(0)
    starts = {draw(config, videos=2, frames=12, rng=rng).start for _ in range(200)}
    assert starts == {5, 6, 7, 8, 9}  # T = 11


def test_about_one_frame_in_twenty_is_dropped_the_same_in_all_videos() -> None:
    rng = np.random.default_rng(0)
    kept = [len(draw(BootifolConfig(), videos=2, frames=61, rng=rng).kept) for _ in range(300)]
    assert 0.94 < np.mean(kept) / 61 < 0.96


def test_frames_per_video_draws_a_new_subset_for_every_video() -> None:
    config = BootifolConfig(frames_per_video=4, frame_drop=0.0)
    drawn = draw(config, videos=6, frames=20, rng=np.random.default_rng(0))
    assert drawn.anchors.shape == drawn.positives.shape == drawn.negatives.shape == (6, 4)
    assert all(len(set(row)) == 4 for row in drawn.anchors)
    assert len({tuple(row) for row in drawn.anchors}) > 1


def test_short_videos_are_refused_with_a_sentence() -> None:
    with pytest.raises(BootifolError, match="5 frames, but the reward model needs at least 6"):
        draw(BootifolConfig(), videos=2, frames=5, rng=np.random.default_rng(0))


def test_videos_too_short_to_lose_frames_keep_them() -> None:
    drawn = draw(BootifolConfig(frame_drop=0.9), videos=2, frames=6, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(drawn.kept, np.arange(6))
