import numpy as np
import pytest

from bootifol.envs.drawn import SPEED
from bootifol.envs.pictures import PictureConfig
from bootifol.experts import drawn_reach, reacher
from bootifol.tasks import make_environment

REWARD_ENDS = 0.025
"""Meters from the target's center: the radius of the target and that of the fingertip."""


def test_the_dot_goes_straight_to_the_goal_and_stops_there() -> None:
    at = np.array([0.1, 0.2])
    np.testing.assert_array_equal(drawn_reach.move(at, np.array([0.9, -0.9])), [1.0, -1.0])
    np.testing.assert_allclose(drawn_reach.move(at, at + np.array([SPEED / 2, 0.0])), [0.5, 0.0], atol=1e-6)
    assert drawn_reach.move(at, at).dtype == np.float32


def test_wrong_places_of_the_drawn_task_are_far_from_the_target() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        target = rng.uniform(-0.75, 0.75, 2)
        place = drawn_reach.wrong_place(target, rng)
        assert np.hypot(*(place - target)) >= 0.6
        assert np.abs(place).max() <= 0.9


def test_wrong_places_of_reacher_are_far_from_the_target_and_within_reach() -> None:
    rng = np.random.default_rng(0)
    distances = []
    for _ in range(3000):
        angle, radius = rng.uniform(-np.pi, np.pi), rng.uniform(0.05, 0.2)
        target = radius * np.array([np.cos(angle), np.sin(angle)])
        place = reacher.wrong_place(target, rng)
        assert 0.08 <= np.hypot(*place) <= 0.2 < 2 * reacher.LINK
        distances.append(np.hypot(*(place - target)))
    assert min(distances) > 0.12 > 4 * REWARD_ENDS
    assert min(distances) < 0.14, "the documented bound is not far from what happens"


@pytest.mark.usefixtures("requires_rendering")
@pytest.mark.parametrize("wrong", [False, True])
def test_the_arm_reaches_its_goal_and_rests_there(wrong: bool) -> None:
    environment = make_environment("reacher_hard", PictureConfig(8, 8, stack=1), 1)
    simulator = environment.simulator
    physics = simulator.physics  # type: ignore[attr-defined]
    for seed in range(6):
        simulator.reset(seed)
        target = reacher.target_position(physics)
        goal = reacher.wrong_place(target, np.random.default_rng(seed)) if wrong else target
        rewards = []
        for step in range(160):
            # As under the task's action repeat: an action holds for two steps.
            if step % 2 == 0:
                action = reacher.torques(physics, goal)
            rewards.append(simulator.step(action)[0])
        finger = physics.named.data.geom_xpos["finger", :2]
        assert np.hypot(*(finger - goal)) < 0.005
        assert np.abs(physics.data.qvel).max() < 1e-3
        assert rewards[-40:] == [float(not wrong)] * 40
        assert np.hypot(*(finger - target)) > 0.08 or not wrong
    environment.close()


@pytest.mark.usefixtures("requires_rendering")
def test_near_misses_of_reacher_are_beside_the_target_and_within_reach() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        angle, radius = rng.uniform(-np.pi, np.pi), rng.uniform(0.05, 0.2)
        target = radius * np.array([np.cos(angle), np.sin(angle)])
        place = reacher.near_miss(target, rng)
        assert 0.04 <= np.hypot(*(place - target)) <= 0.06
        assert np.hypot(*place) < 2 * reacher.LINK


def test_the_wrong_place_is_wrong_in_real_episodes() -> None:
    environment = make_environment("reacher_hard", PictureConfig(8, 8, stack=1), 1)
    simulator = environment.simulator
    for seed in range(100):
        simulator.reset(seed)
        target = reacher.target_position(simulator.physics)  # type: ignore[attr-defined]
        assert 0.05 <= np.hypot(*target) <= 0.2
        assert np.hypot(*(reacher.wrong_place(target, np.random.default_rng(seed)) - target)) > 0.12
    environment.close()
