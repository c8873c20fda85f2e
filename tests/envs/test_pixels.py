import gymnasium
import numpy as np
import pytest
from counting_simulator import CountingSimulator
from gymnasium.utils.env_checker import check_env

from bootifol.envs.pictures import PictureConfig
from bootifol.envs.pixels import PixelEnvironment
from bootifol.tasks import TASKS, make_environment

SIZES = PictureConfig(agent_size=16, video_size=8, stack=3)
NOTHING = np.zeros(2, np.float32)


def counting(
    pictures: PictureConfig = SIZES,
    action_repeat: int = 1,
    episode_steps: int = 5,
    ends_at: int | None = None,
) -> tuple[PixelEnvironment, CountingSimulator]:
    simulator = CountingSimulator(pictures.picture_size, ends_at)
    return PixelEnvironment(simulator, pictures, action_repeat, episode_steps), simulator


def stacked(observation: np.ndarray) -> list[int]:
    """The colors of an observation's frames, in the order of its channels."""
    frames = observation.reshape(16, 16, 3, 3)
    assert all(len(np.unique(frames[:, :, k])) == 1 for k in range(3))
    return [int(frames[0, 0, k, 0]) for k in range(3)]


def test_the_first_frame_is_repeated_and_the_oldest_comes_first() -> None:
    environment, _ = counting()
    observation, _ = environment.reset(seed=0)
    assert (observation.shape, observation.dtype) == ((16, 16, 9), np.uint8)
    assert stacked(observation) == [0, 0, 0]
    assert [stacked(environment.step(NOTHING)[0]) for _ in range(4)] == [
        [0, 0, 1],
        [0, 1, 2],
        [1, 2, 3],
        [2, 3, 4],
    ]
    assert stacked(environment.reset(seed=0)[0]) == [0, 0, 0]


def test_an_observation_is_not_changed_by_later_steps() -> None:
    environment, _ = counting()
    observation, info = environment.reset(seed=0)
    before = observation.copy(), info["frame"].copy()
    environment.step(NOTHING)
    np.testing.assert_array_equal(observation, before[0])
    np.testing.assert_array_equal(info["frame"], before[1])


def test_rewards_are_summed_over_the_action_repeat() -> None:
    environment, simulator = counting(action_repeat=3)
    environment.reset(seed=0)
    action = np.array([0.25, -1.0], np.float32)
    assert environment.step(action)[1] == 2.0 + 4.0 + 8.0
    assert environment.step(NOTHING)[1] == 16.0 + 32.0 + 64.0
    assert simulator.count == 6
    np.testing.assert_array_equal(simulator.actions[:3], [action] * 3)


def test_the_time_limit_truncates_and_counts_agent_steps() -> None:
    environment, _ = counting(action_repeat=2, episode_steps=3)
    environment.reset(seed=0)
    ends = [environment.step(NOTHING)[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


def test_a_termination_ends_the_action_repeat_too() -> None:
    environment, simulator = counting(action_repeat=4, ends_at=2)
    environment.reset(seed=0)
    _, reward, terminated, truncated, info = environment.step(NOTHING)
    assert (reward, terminated, truncated, simulator.count) == (6.0, True, False, 2)
    assert info["success"] is True


def test_steps_before_a_start_and_after_the_end_are_refused() -> None:
    environment, _ = counting(episode_steps=1)
    with pytest.raises(RuntimeError, match="call reset"):
        environment.step(NOTHING)
    environment.reset(seed=0)
    environment.step(NOTHING)
    with pytest.raises(RuntimeError, match="the episode is over"):
        environment.step(NOTHING)
    environment.reset(seed=0)
    environment.step(NOTHING)


def test_one_picture_a_step_serves_agent_and_reward_model() -> None:
    environment, simulator = counting()
    _, info = environment.reset(seed=0)
    infos = [info, *(environment.step(NOTHING)[4] for _ in range(4))]
    assert simulator.renders == 5
    assert {info["frame"].shape for info in infos} == {(16, 16, 3)}
    assert {info["video_frame"].shape for info in infos} == {(8, 8, 3)}
    assert [int(info["video_frame"][0, 0, 0]) for info in infos] == [0, 1, 2, 3, 4]


def test_where_nobody_looks_nothing_is_painted() -> None:
    environment, simulator = counting()
    environment.rendered = False
    seen, _ = environment.reset(seed=0)
    after, reward, *_ = environment.step(NOTHING)
    assert not seen.any()
    assert not after.any()
    assert simulator.renders == 0
    assert reward > 0


def test_equal_sizes_share_one_array() -> None:
    environment, _ = counting(PictureConfig(agent_size=8, video_size=8))
    _, info = environment.reset(seed=0)
    assert info["frame"] is info["video_frame"]


def test_actions_out_of_range_are_clipped() -> None:
    environment, simulator = counting()
    environment.reset(seed=0)
    environment.step(np.array([-7.0, 1.5], np.float32))
    np.testing.assert_array_equal(simulator.actions[0], [-1.0, 1.0])


@pytest.mark.parametrize("action", [[np.nan, 0.0], [np.inf, 0.0], [0.0], [0.0, 0.0, 0.0], 0.5])
def test_actions_that_mean_nothing_are_refused_before_anything_moves(action: object) -> None:
    environment, simulator = counting()
    environment.reset(seed=0)
    with pytest.raises(ValueError, match=r"an action here is \(2,\) finite numbers"):
        environment.step(np.asarray(action, np.float32))
    assert simulator.count == 0


def test_starts_without_a_seed_differ_and_follow_from_the_last_seed() -> None:
    environment, simulator = counting()
    for seed in (3, None, None, 3, None, None):
        environment.reset(seed=seed)
    first, again = simulator.seeds[:3], simulator.seeds[3:]
    assert first == again
    assert len(set(first)) == 3


def test_frames_per_second_follow_from_time_and_repetition() -> None:
    assert counting(action_repeat=2)[0].metadata["render_fps"] == 10.0


def test_closing_closes_the_simulator() -> None:
    environment, simulator = counting()
    environment.close()
    assert simulator.closed


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("task", list(TASKS))
def test_gymnasium_approves(task: str, request: pytest.FixtureRequest) -> None:
    if not task.startswith("drawn"):
        request.getfixturevalue("requires_rendering")
    environment = make_environment(task, PictureConfig(agent_size=36, video_size=8), 4)
    assert isinstance(environment, gymnasium.Env)
    check_env(environment, skip_render_check=True)
    environment.close()
