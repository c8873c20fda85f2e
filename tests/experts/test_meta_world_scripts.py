from typing import Any

import numpy as np
import pytest

from bootifol.envs.pictures import PictureConfig
from bootifol.envs.pixels import PixelEnvironment
from bootifol.envs.rollout import PlayedEpisode, play_episode
from bootifol.experts import Behavior, make_behavior, meta_world
from bootifol.tasks import TASKS, make_environment

pytestmark = [pytest.mark.usefixtures("requires_rendering"), pytest.mark.filterwarnings("error")]

NAMES = [task.name for task in TASKS.values() if task.suite == "Meta-World"]


def environment_of(task: str) -> PixelEnvironment:
    environment = make_environment(task, PictureConfig(8, 8, stack=1), TASKS[task].episode_steps)
    environment.rendered = False
    return environment


def played(task: str, environment: PixelEnvironment, behavior: Behavior, seed: int) -> PlayedEpisode:
    return play_episode(environment, make_behavior(behavior, task, environment, seed), seed, behavior)


@pytest.mark.parametrize("task", NAMES)
def test_the_expert_succeeds_from_every_start_within_an_episode(task: str) -> None:
    environment = environment_of(task)
    experts = [played(task, environment, "expert", seed) for seed in range(3)]
    assert all(episode.success for episode in experts)
    half_good = [played(task, environment, "half_good", seed) for seed in range(3)]
    assert sum(bool(episode.success) for episode in half_good) <= 1
    worst = min(episode.environment_return for episode in experts)
    assert worst > 1.2 * np.mean([episode.environment_return for episode in half_good])
    actions = np.concatenate([episode.episode.actions for episode in experts])
    assert actions.shape[1] == 4
    assert np.abs(actions).max() <= 1.0
    environment.close()


@pytest.mark.parametrize("task", NAMES)
def test_a_near_miss_is_one(task: str) -> None:
    environment = environment_of(task)
    environment.reset(seed=0)
    true = environment.simulator.observation[meta_world.GOALS[task]].copy()
    near = meta_world.near_miss(task, environment.simulator, np.random.default_rng(0))
    assert 0.07 <= np.linalg.norm(near - true) <= 0.09
    over = False
    while not over:
        _, _, _, over, info = environment.step(meta_world.script(task, environment.simulator)(near))
        assert not info["success"]
    environment.close()


@pytest.mark.parametrize("task", NAMES)
def test_toward_a_wrong_place_the_same_script_fails(task: str) -> None:
    environment = environment_of(task)
    simulator: Any = environment.simulator
    controller = meta_world.script(task, simulator)
    for seed in range(2):
        environment.reset(seed=seed)
        true = simulator.observation[meta_world.GOALS[task]].copy()
        wrong = meta_world.wrong_place(task, simulator, np.random.default_rng(seed))
        assert 0.2 <= np.linalg.norm(wrong - true) <= 0.3
        over, succeeded = False, False
        while not over:
            _, _, _, over, info = environment.step(controller(wrong))
            succeeded |= info["success"]
        assert not succeeded
        # It is the same script: the hand gets about as near to the wrong place as the expert's to the true one.
        assert abs(simulator.observation[0] - wrong[0]) < 0.06
    environment.close()
