"""Expert videos corrupted in time: where each frame comes from."""

from __future__ import annotations

import numpy as np

from bootifol.rewards.bootifol.time_corrupted import LATEST_TURN, time_corrupted

FRAMES, COUNT = 31, 300
LATEST = int(LATEST_TURN * (FRAMES - 1))


def numbered() -> np.ndarray:
    """Videos whose pixels are the number of their frame."""
    frames = np.broadcast_to(
        np.arange(FRAMES, dtype=np.uint8)[None, :, None, None, None], (COUNT, FRAMES, 4, 4, 3)
    )
    return frames.copy()


def test_three_ways_to_fail() -> None:
    videos = numbered()
    shown = time_corrupted(videos, np.random.default_rng(0))
    assert shown.shape == videos.shape and shown.dtype == np.uint8
    np.testing.assert_array_equal(videos, numbered())
    stopped = turned = reversed_ = 0
    for order in shown[:, :, 0, 0, 0].astype(int):
        moves = np.diff(order)
        assert set(np.unique(moves)) <= {-1, 0, 1}
        assert order.max() <= 2 * LATEST, "nobody arrives"
        if order[0] > 0:
            assert (moves <= 0).all() and order[-1] == 0
            reversed_ += 1
        elif (moves >= 0).all():
            assert 1 <= order[-1] <= LATEST
            stopped += 1
        else:
            assert order[-1] == 0
            turned += 1
    assert min(stopped, turned, reversed_) > COUNT / 5


def test_short_videos_and_the_same_draw_twice() -> None:
    videos = numbered()[:, :3]
    one, two = (time_corrupted(videos, np.random.default_rng(1)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
