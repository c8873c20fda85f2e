"""Environments of other people that answer otherwise than Gymnasium's do today."""

import random
import warnings

import gymnasium
import numpy as np
import pytest
import tiny_environments

from bootifol.envs import any_gymnasium
from bootifol.envs.any_gymnasium import GymnasiumSimulator, step_seconds
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError, BootifolWarning

SIZES = PictureConfig(agent_size=20, video_size=20)
STILL = np.zeros(2, np.float32)


def simulator(function: str) -> GymnasiumSimulator:
    return GymnasiumSimulator(f"tiny_environments:{function}", SIZES)


@pytest.mark.parametrize("function", ["make_old_reset", "make_old_reset_wrapped"])
def test_an_old_reset_is_seeded_by_its_method(function: str) -> None:
    made = simulator(function)
    made.require_sights()
    starts = []
    for seed in (3, 4, 3):
        made.reset(seed)
        starts.append(made.render())
    np.testing.assert_array_equal(starts[0], starts[2])
    assert (starts[0] != starts[1]).any()


def test_an_old_step_ends_or_is_cut_as_it_says() -> None:
    made = simulator("make_old_step")
    made.reset(0)
    ends = [(made.step(STILL)[1], made.truncated) for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)], "time was up at the third step"
    made.reset(0)
    ended = [made.step(np.ones(2, np.float32))[1] for _ in range(2)]
    assert not any(ended) and not made.truncated


def test_an_old_step_below_wrappers_of_today_is_read() -> None:
    made, plain = simulator("make_old_step_wrapped"), simulator("make")
    made.reset(0), plain.reset(0)
    assert made.step(STILL)[0] == pytest.approx(2 * plain.step(STILL)[0])


@pytest.mark.parametrize(
    ("function", "answer"),
    [
        ("make_array_reward", (0.5, False, False)),
        ("make_no_info", (None, False, None)),
        ("make_array_success", (None, False, True)),
    ],
)
def test_answers_that_can_mean_one_thing_only_are_taken_so(
    function: str, answer: tuple[float | None, bool, bool | None]
) -> None:
    made = simulator(function)
    made.require_sights()
    made.reset(0)
    reward, ended, success = made.step(STILL)
    assert (ended, success) == answer[1:]
    assert isinstance(reward, float) and answer[0] in (None, reward)


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        ("make_two_rewards", r"the reward has shape \[2\] where one number is wanted"),
        ("make_no_reward", "the reward is None where one number is wanted"),
        ("make_two_ends", r"terminated has shape \[2\] where one number is wanted"),
        ("make_worded_reward", "the reward is str where a number is wanted"),
        ("make_two_successes", r'info\["success"\] has shape \[2\]'),
        ("make_three_values", r"step\(\) returns 3 values where Gymnasium has 5"),
        (
            "make_diverging",
            r"failed in step\(\): Physics diverged \(RuntimeError in tiny_environments.py, line \d+\)",
        ),
        ("make_blank", "draws nothing: every picture is of one color, black"),
        ("make_blank_white", "draws nothing: every picture is of one color, white"),
    ],
)
def test_others_get_a_sentence_before_anything_is_written(function: str, sentence: str) -> None:
    with pytest.raises(BootifolError, match=sentence) as raised:
        simulator(function).require_sights()
    assert f"tiny_environments:{function}" in str(raised.value)


def test_a_picture_that_comes_later_is_waited_for() -> None:
    simulator("make_blank_at_first").require_sights()


def test_without_a_display_sdl_draws_offscreen(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(any_gymnasium.sys, "platform", "linux")
    simulator("make_blank_if_dummy").require_sights()
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with pytest.raises(BootifolError, match="SDL_VIDEODRIVER is dummy, and some draw nothing then: unset it"):
        simulator("make_blank_if_dummy").require_sights()


@pytest.mark.parametrize(
    "function", ["make_ignoring_numpy", "make_ignoring_python", "make_ignoring_before", "make_private"]
)
def test_starts_follow_from_the_seed_wherever_they_are_drawn(function: str) -> None:
    made = simulator(function)
    with warnings.catch_warnings():
        warnings.simplefilter("error", BootifolWarning)
        made.require_sights()
    before = np.random.get_state()[1].tolist(), random.getstate()
    made.reset(5)
    first = made.render()
    assert (np.random.get_state()[1].tolist(), random.getstate()) == before, "nobody else's draws change"
    made.reset(6)
    assert (made.render() != first).any()
    made.reset(5)
    np.testing.assert_array_equal(made.render(), first)


def test_an_environment_that_ignores_its_seed_is_told() -> None:
    with pytest.warns(BootifolWarning, match="starts elsewhere when it is reset twice with one seed"):
        simulator("make_ignoring_own").require_sights()


@pytest.mark.parametrize("rate", [np.int64(20), np.float32(20), np.array(20), 20, 20.0])
def test_a_rate_may_be_any_kind_of_number(rate: object) -> None:
    environment = tiny_environments.make()
    environment.metadata = {"render_fps": rate}
    assert step_seconds(environment) == pytest.approx(0.05)


@pytest.mark.parametrize("rate", [None, 0, -1, "fast", np.nan, np.inf, [20, 30]])
def test_what_is_no_rate_leaves_the_step_to_dt(rate: object) -> None:
    environment: gymnasium.Env = tiny_environments.make()  # type: ignore[type-arg]
    environment.metadata = {"render_fps": rate}
    assert step_seconds(environment) is None
    environment.dt = np.float32(0.25)  # type: ignore[attr-defined]
    assert step_seconds(environment) == 0.25
