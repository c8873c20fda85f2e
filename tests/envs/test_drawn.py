import numpy as np
import pytest

from bootifol.envs.drawn import BACKGROUND, DOT_COLOR, SPEED, TARGET_COLOR, TARGET_RADIUS, DrawnReach
from bootifol.envs.pictures import PictureConfig


def simulator(size: int = 32) -> DrawnReach:
    return DrawnReach(PictureConfig(agent_size=size, video_size=size))


def test_starts_follow_from_the_seed_alone_and_keep_dot_and_target_apart() -> None:
    drawn = simulator()
    starts = []
    for seed in (*range(30), *range(30)):
        drawn.reset(seed)
        drawn.step(np.ones(2, np.float32))
        drawn.reset(seed)
        starts.append((*drawn.dot, *drawn.target))
        assert np.hypot(*(drawn.dot - drawn.target)) >= 0.5
    assert starts[:30] == starts[30:]
    assert len(set(starts)) == 30


def test_the_dot_moves_along_the_action_and_stays_in_the_field() -> None:
    drawn = simulator()
    drawn.dot[:] = 0.0, 0.9
    drawn.step(np.array([0.5, 1.0], np.float32))
    np.testing.assert_allclose(drawn.dot, [SPEED / 2, 0.95])


@pytest.mark.parametrize(
    ("distance", "reward", "success"),
    [(0.0, 1.0, True), (0.19, 1.0, True), (0.21, 0.98, False), (0.45, 0.5, False), (0.75, 0.0, False)],
)
def test_the_reward_is_1_within_the_target_and_falls_to_0(
    distance: float, reward: float, success: bool
) -> None:
    drawn = simulator()
    drawn.target[:] = 0.1, -0.2
    drawn.dot[:] = 0.1 + distance, -0.2
    got, terminated, succeeded = drawn.step(np.zeros(2, np.float32))
    assert got == pytest.approx(reward)
    assert (terminated, succeeded) == (False, success)


def test_the_picture_shows_dot_and_target_where_they_are() -> None:
    drawn = simulator(32)
    drawn.target[:] = -0.5, 0.5
    drawn.dot[:] = 0.5, -0.5
    picture = drawn.render()
    assert (picture.shape, picture.dtype) == ((32, 32, 3), np.uint8)
    # x to the right, y upward: the target is at the upper left.
    np.testing.assert_array_equal(picture[8, 8], TARGET_COLOR)
    np.testing.assert_array_equal(picture[24, 24], DOT_COLOR)
    np.testing.assert_array_equal(picture[8, 24], BACKGROUND)
    covered = (picture != BACKGROUND.astype(np.uint8)).any(axis=2)[:16, :16].sum()
    assert covered == pytest.approx(np.pi * (TARGET_RADIUS * 16) ** 2, rel=0.6)


@pytest.mark.parametrize("size", [8, 16, 61])
def test_every_corner_of_the_field_can_be_drawn_at_any_size(size: int) -> None:
    drawn = simulator(size)
    for x in (-0.95, 0.0, 0.95):
        for y in (-0.95, 0.0, 0.95):
            drawn.dot[:], drawn.target[:] = (x, y), (-x, 0.3)
            picture = drawn.render()
            column, row = int((x + 1) / 2 * size), int((1 - y) / 2 * size)
            assert not np.array_equal(picture[min(row, size - 1), min(column, size - 1)], BACKGROUND)


def test_the_dot_covers_the_target() -> None:
    drawn = simulator()
    drawn.target[:] = drawn.dot[:] = 0.03
    np.testing.assert_array_equal(drawn.render()[15, 16], DOT_COLOR)
