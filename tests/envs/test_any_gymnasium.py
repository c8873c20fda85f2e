import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import tiny_environments
from gymnasium.utils.env_checker import check_env
from tiny_environments import Slide

from bootifol.envs.any_gymnasium import GymnasiumSimulator, step_seconds, without_time_limit
from bootifol.envs.pictures import PictureConfig, centered_square
from bootifol.errors import BootifolError
from bootifol.tasks import make_environment, task_named

SIZES = PictureConfig(agent_size=20, video_size=10, stack=2)
SLIDE = "gymnasium:Tiny/Slide-v0"


@pytest.fixture(autouse=True)
def registered() -> None:
    tiny_environments.register()


def simulator(name: str = SLIDE) -> GymnasiumSimulator:
    return GymnasiumSimulator(name, SIZES)


def test_gymnasium_approves() -> None:
    environment = make_environment(SLIDE, SIZES, 4)
    check_env(environment, skip_render_check=True)


def test_actions_reach_the_bounds_of_the_environments_own_box() -> None:
    made = simulator()
    made.reset(seed=0)
    for action in ([-1.0, -1.0], [0.0, 0.0], [1.0, 1.0]):
        made.step(np.float32(action))
    slide = made.environment.unwrapped
    assert isinstance(slide, Slide)
    np.testing.assert_array_equal(slide.actions, [[-1.0, 2.0], [0.0, 4.0], [1.0, 6.0]])
    assert slide.actions[0].dtype == np.float32


def test_a_picture_is_the_centered_square_that_import_cuts_out_too() -> None:
    made = simulator()
    made.reset(seed=3)
    whole = made.environment.render()
    assert isinstance(whole, np.ndarray) and whole.shape == (20, 32, 3)
    picture = made.render()
    assert picture.shape == (20, 20, 3)
    np.testing.assert_array_equal(picture, whole[:, 6:26])
    np.testing.assert_array_equal(picture, centered_square(whole, 20))
    assert not (picture == (255, 0, 0)).all(axis=-1).any(), "the border is left out"


def test_an_environment_may_draw_every_picture_into_the_same_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    environment = make_environment(SLIDE, PictureConfig(20, 20), 4)
    slide, memory = environment.simulator.environment.unwrapped, np.zeros((20, 32, 3), np.uint8)
    render = slide.render

    def render_into_memory() -> np.ndarray:
        memory[:] = render()
        return memory

    _, first = environment.reset(seed=0)
    monkeypatch.setattr(slide, "render", render_into_memory)
    frames = [environment.step(np.float32([1.0, 0.0]))[4]["frame"] for _ in range(3)]
    assert len({frame.tobytes() for frame in [first["frame"], *frames]}) == 4


def test_the_same_seed_gives_the_same_start_in_any_instance() -> None:
    def start(seed: int) -> np.ndarray:
        environment = make_environment(SLIDE, SIZES, 4)
        return environment.reset(seed=seed)[0]

    np.testing.assert_array_equal(start(5), start(5))
    assert (start(5) != start(6)).any()


def test_terminations_and_success_are_passed_on_and_its_own_time_limit_is_not() -> None:
    environment = make_environment(SLIDE, SIZES, 60)
    environment.reset(seed=0)
    still = [environment.step(np.zeros(2, np.float32)) for _ in range(20)]  # registered with 7 steps
    assert not any(terminated or truncated for _, _, terminated, truncated, _ in still)
    assert still[-1][4]["success"] is False
    for _ in range(30):
        _, _, terminated, truncated, info = environment.step(np.ones(2, np.float32))
        if terminated:
            break
    assert terminated and not truncated and info["success"] is True


def test_an_environment_that_cuts_episodes_for_its_own_reasons_truncates() -> None:
    environment = make_environment("gymnasium:Tiny/Cut-v0", SIZES, 60, action_repeat=2)
    environment.reset(seed=0)
    ends = [environment.step(np.zeros(2, np.float32))[2:4] for _ in range(2)]
    assert ends == [(False, False), (False, True)]
    environment.reset(seed=0)
    assert environment.step(np.zeros(2, np.float32))[2:4] == (False, False), "a new episode is not cut"


@pytest.mark.parametrize(("name", "limit"), [(SLIDE, 7), ("tiny_environments:make_limited_inside", 4)])
def test_time_limits_are_taken_off_at_any_depth(name: str, limit: int) -> None:
    made = simulator(name)
    assert made.time_limit == limit
    made.reset(seed=0)
    for _ in range(2 * limit):
        made.step(np.zeros(2, np.float32))
        assert not made.truncated


def test_an_environment_without_a_limit_has_none() -> None:
    assert without_time_limit(Slide("rgb_array"))[1] is None


def test_the_task_takes_its_lengths_from_the_environment() -> None:
    task = task_named(SLIDE)
    assert (task.action_repeat, task.episode_steps, task.evaluation_steps) == (1, 7, 7)
    assert (task.expert_return, task.random_return, task.has_expert) == (None, None, False)
    assert task_named("gymnasium:Tiny/Endless-v0").episode_steps == 200
    coarser = task_named(SLIDE, action_repeat=2)
    assert (coarser.action_repeat, coarser.episode_steps, coarser.evaluation_steps) == (2, 4, 4)
    assert task_named(SLIDE, episode_steps=3).evaluation_steps == 7


def test_time_comes_from_the_environment_or_is_known_to_be_assumed() -> None:
    assert make_environment(SLIDE, SIZES, 4, action_repeat=2).metadata["render_fps"] == 10.0
    environment: Any = tiny_environments.make_without_time()
    assert step_seconds(environment) is None
    environment.dt = 0.02
    assert step_seconds(environment) == 0.02
    assumed = make_environment("tiny_environments:make_without_time", SIZES, 4)
    assert (assumed.knows_time, assumed.metadata["render_fps"]) == (False, 25.0)


def test_a_function_in_the_current_directory_makes_an_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "my_robot_of_a_test"
    package.mkdir()
    (package / "tasks.py").write_text(
        "from tiny_environments import Slide\ndef make(): return Slide('rgb_array')\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert task_named("my_robot_of_a_test.tasks:make").episode_steps == 200


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("gymnasium:Tiny/Slid-v0", "Did you mean: `Slide`"),
        ("gymnasium:Tiny/Slide-v1", "name that package too: gymnasium:PACKAGE:Tiny/Slide-v1"),
        ("gymnasium:", "cannot be made: Malformed environment ID"),
        (
            "gymnasium:no_package_of_a_test:Reach-v0",
            "needs a package that is missing: No module named 'no_package",
        ),
        (
            "gymnasium:Tiny/Missing-v0",
            "needs a package that is missing: No module named 'a_package_that_is_missing'",
        ),
        (
            "gymnasium:Tiny/Discrete-v0",
            r"has discrete actions \(Discrete\(3\)\) and bootifol acts with continuous",
        ),
        (
            "gymnasium:Tiny/DictActions-v0",
            "has Dict actions and bootifol acts with continuous.*TransformAction",
        ),
        ("gymnasium:Tiny/Unbounded-v0", "have no bounds.*finite bounds"),
        ("gymnasium:Tiny/Blind-v0", "renders no pictures.*its render modes are human"),
        ("gymnasium:Tiny/WithoutRenderMode-v0", "renders no pictures.*constructor takes no render_mode"),
        ("gymnasium:Tiny/ManyPictures-v0", "renders list where a picture is wanted"),
        ("gymnasium:Tiny/Gray-v0", r"renders uint8 \[4, 4\] where a picture is wanted"),
        ("tiny_environments:Slide", "renders no pictures.*render_mode is None"),
        ("tiny_environments:make_number", "returned int, not a gymnasium.Env"),
        (
            "tiny_environments:make_failing",
            r"no robot is plugged in \(RuntimeError in tiny_environments.py, line \d+",
        ),
        ("tiny_environments:mak", "has no function mak; it has Slide, .*make"),
        ("no_module_of_a_test:make", "no module no_module_of_a_test.*neither in"),
        ("tiny_environments:", "names no environment: write gymnasium:ID"),
        ("tiny environments:make", "names no environment: write gymnasium:ID"),
    ],
)
def test_what_cannot_be_used_gets_a_sentence(name: str, sentence: str) -> None:
    with pytest.raises(BootifolError, match=sentence) as raised:
        task_named(name)
    assert "\n" not in str(raised.value)


def test_a_module_that_fails_says_where(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    Path("broken_of_a_test.py").write_text("\n1 / 0\n")
    with pytest.raises(
        BootifolError, match=r"division by zero \(ZeroDivisionError in broken_of_a_test.py, line 2\)"
    ):
        task_named("broken_of_a_test:make")
    Path("needy_of_a_test.py").write_text("import a_package_that_is_missing\n")
    with pytest.raises(
        BootifolError, match="missing: No module named 'a_package_that_is_missing'; install it"
    ):
        task_named("needy_of_a_test:make")


def test_a_renderer_that_fails_gets_a_sentence_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bootifol.demos.record import record

    def no_screen(self: Slide) -> None:
        raise OSError("no screen")

    monkeypatch.setattr(Slide, "render", no_screen)
    with pytest.raises(BootifolError, match="cannot render pictures here: no screen"):
        record("gymnasium:Tiny/Slide-v0", "random", 1, tmp_path / "random", SIZES)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(find_spec("pygame") is None, reason="needs `pip install 'bootifol[gymnasium]'`")
def test_pendulum_moves_in_pictures() -> None:
    environment = make_environment("gymnasium:Pendulum-v1", PictureConfig(32, 32), 3)
    before = environment.reset(seed=0)[1]["frame"]
    after = [environment.step(np.ones(1, np.float32))[4]["frame"] for _ in range(3)][-1]
    assert before.shape == (32, 32, 3) and np.ptp(before) > 100
    assert (before != after).any()
    environment.close()


@pytest.mark.usefixtures("requires_rendering")
@pytest.mark.skipif(find_spec("imageio") is None, reason="needs `pip install 'bootifol[gymnasium]'`")
def test_mujoco_environments_of_gymnasium_do_not_draw_into_each_other() -> None:
    first = GymnasiumSimulator("gymnasium:Reacher-v5", SIZES)
    first.reset(seed=0)
    alone = first.render()
    second = GymnasiumSimulator("gymnasium:InvertedPendulum-v5", SIZES)
    second.reset(seed=0)
    assert (second.render() != alone).any()
    np.testing.assert_array_equal(first.render(), alone)
    second.close()
    np.testing.assert_array_equal(first.render(), alone)
    first.close()


@pytest.mark.parametrize("identifier", ["Tiny/DictActions-v0", "Tiny/Unbounded-v0"])
def test_the_wrapper_that_a_refusal_names_helps(identifier: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrapped() -> gymnasium.Env[Any, Any]:
        inside = gymnasium.make(identifier, render_mode="rgb_array")
        box = gymnasium.spaces.Box(-1.0, 1.0, (1,))
        return gymnasium.wrappers.TransformAction(inside, lambda action: {"a": action}, box)

    monkeypatch.setattr(tiny_environments, "wrapped", wrapped, raising=False)
    made = simulator("tiny_environments:wrapped")
    assert (made.action_dim, made.time_limit) == (1, 7)


def test_registered_environments_are_left_as_they_were() -> None:
    simulator()
    assert gymnasium.spec("Tiny/Slide-v0").max_episode_steps == 7


@pytest.mark.usefixtures("requires_rendering")
@pytest.mark.skipif(find_spec("imageio") is None, reason="needs `pip install 'bootifol[gymnasium]'`")
def test_the_example_of_the_documentation_is_a_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[2] / "docs" / "environments.md").read_text()
    example = page.partition("```python\n# my_robot.py\n")[2].partition("```")[0]
    (tmp_path / "my_robot_of_the_documentation.py").write_text(example)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    made = simulator("my_robot_of_the_documentation:make")
    whole = simulator("gymnasium:Reacher-v5")
    made.reset(seed=0)
    whole.reset(seed=0)
    made.step(np.float32([1.0, -0.5]))
    whole.step(np.float32([0.2, -0.1]))
    reached, same = (one.environment.unwrapped.data.qvel for one in (made, whole))
    np.testing.assert_allclose(reached, same, rtol=1e-5)
    assert not np.array_equal(made.render(), whole.render()), "seen from another place"
    made.close()
    whole.close()
