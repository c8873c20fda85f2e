import importlib
import random
import sys
from typing import Any, get_args

import numpy as np
import pytest

from bootifol.envs import meta_world
from bootifol.envs.pictures import PictureConfig, RenderProfile
from bootifol.envs.pixels import PixelEnvironment
from bootifol.errors import BootifolError
from bootifol.tasks import TASKS, make_environment

pytestmark = pytest.mark.usefixtures("requires_rendering")

NAMES = [task.name for task in TASKS.values() if task.suite == "Meta-World"]
SMALL = PictureConfig(agent_size=16, video_size=8, stack=1)


def environment_of(task: str, episode_steps: int = 5, pictures: PictureConfig = SMALL) -> PixelEnvironment:
    return make_environment(task, pictures, episode_steps)


def playing(environment: PixelEnvironment, seed: int) -> Any:
    """Plays with actions of its own; gives what was seen, the reward and the state behind it, step by step."""
    actions = np.random.default_rng([seed, 5])
    frame = environment.reset(seed=seed)[1]["frame"]
    while True:
        data = environment.simulator.environment.data  # type: ignore[attr-defined]
        yield frame.tobytes(), data.qpos.tobytes()
        _, reward, *_, info = environment.step(actions.uniform(-1, 1, 4).astype(np.float32))
        frame = info["frame"]
        yield reward


def steps_of(episode: Any, count: int) -> list[Any]:
    return [next(episode) for _ in range(count)]


def states_of_global_generators() -> tuple[object, ...]:
    _, keys, *rest = np.random.get_state()
    return np.asarray(keys).tobytes(), rest, random.getstate()


@pytest.mark.parametrize("task", NAMES)
def test_neither_other_environments_nor_earlier_episodes_nor_global_states_matter(task: str) -> None:
    first = environment_of(task)
    alone = steps_of(playing(first, 3), 4)
    steps_of(playing(first, 8), 4)
    again, other = playing(first, 3), playing(environment_of(task), 4)
    interleaved: tuple[list[Any], list[Any]] = ([], [])
    for _ in range(4):
        np.random.seed(0)  # a caller's own seeding makes no difference
        interleaved[1].append(next(other))
        interleaved[0].append(next(again))
    assert interleaved[0] == alone
    assert interleaved[1] != alone


@pytest.mark.parametrize("task", NAMES)
def test_global_random_states_are_left_alone(task: str) -> None:
    states = states_of_global_generators()
    steps_of(playing(environment_of(task), 0), 4)
    assert states_of_global_generators() == states


@pytest.mark.parametrize("task", NAMES)
def test_objects_or_goal_lie_elsewhere_in_every_episode_and_one_sees_it(task: str) -> None:
    environment = environment_of(task, pictures=PictureConfig(32, 32, stack=1))
    frames = {environment.reset(seed=seed)[1]["frame"].tobytes() for seed in range(3)}
    assert len(frames) == 3
    environment.close()


def test_the_first_picture_shows_the_goal_where_it_is() -> None:
    environment = environment_of("plate_slide")
    environment.rendered = False
    simulator: Any = environment.simulator
    for seed in range(2):
        environment.reset(seed=seed)
        shown = simulator.environment.data.site("goal").xpos
        np.testing.assert_allclose(shown, simulator.observation[36:39])
        before = simulator.observation[36:39].copy()
        environment.step(np.zeros(4, np.float32))
        np.testing.assert_array_equal(simulator.observation[36:39], before)


@pytest.mark.parametrize("task", NAMES)
def test_the_time_limit_is_ours_even_beyond_meta_worlds(task: str) -> None:
    environment = environment_of(task, 3)
    environment.rendered = False
    environment.reset(seed=0)
    # Meta-World would raise at the 500th of its steps.
    environment.simulator.environment.curr_path_length = 498  # type: ignore[attr-defined]
    ends = [environment.step(np.ones(4, np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    environment.close()


def test_actions_move_the_hand_along_the_axes_and_close_the_gripper() -> None:
    environment = environment_of("button_press", 30)
    environment.rendered = False
    simulator: Any = environment.simulator
    for axis in range(3):
        action = np.zeros(4, np.float32)
        action[axis] = 1.0
        environment.reset(seed=0)
        start = simulator.observation[:3].copy()
        for _ in range(5):
            info = environment.step(action)[-1]
        moved = simulator.observation[:3] - start
        assert np.argmax(np.abs(moved)) == axis
        assert moved[axis] > 0.02
        assert info["success"] is False
    opening = []
    for gripper in (1.0, -1.0):
        environment.reset(seed=0)
        for _ in range(10):
            environment.step(np.array([0, 0, 0, gripper], np.float32))
        opening.append(simulator.observation[3])
    assert opening[0] < opening[1] - 0.1
    environment.close()


@pytest.mark.parametrize("profile", get_args(RenderProfile))
def test_pictures_have_the_size_asked_for_and_are_upright(profile: RenderProfile) -> None:
    environment = environment_of("button_press", 1, PictureConfig(48, 24, stack=2, profile=profile))
    observation, info = environment.reset(seed=0)
    assert observation.shape == (48, 48, 6)
    assert info["video_frame"].shape == (24, 24, 3)
    picture = info["frame"].astype(int)
    wood = (picture[..., 0] > picture[..., 2] + 15) & (np.abs(picture[..., 0] - 110) < 40)
    assert wood[24:].sum() > 2 * wood[:24].sum(), "the table fills the lower half"
    environment.close()


def test_without_meta_world_a_sentence_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [name for name in sys.modules if name.partition(".")[0] == "metaworld"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "metaworld", None)
    with pytest.raises(BootifolError, match=r"not installed; type `pip install 'bootifol\[metaworld\]'`"):
        make_environment("button_press", SMALL, 1)


def test_another_missing_package_is_not_blamed_on_meta_world(monkeypatch: pytest.MonkeyPatch) -> None:
    def without_scipy(name: str) -> Any:
        raise ModuleNotFoundError("No module named 'scipy'", name="scipy")

    monkeypatch.setattr(importlib, "import_module", without_scipy)
    with pytest.raises(BootifolError, match="metaworld needs scipy, which is not installed"):
        meta_world.load_meta_world("env_dict")
