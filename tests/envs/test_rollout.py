from collections.abc import Iterator

import numpy as np
import pytest
from counting_simulator import CountingSimulator

from bootifol.envs.pictures import PictureConfig
from bootifol.envs.pixels import PixelEnvironment
from bootifol.envs.rollout import EpisodeRecorder, play_episode, rollout
from bootifol.types import Action, Observation

SIZES = PictureConfig(agent_size=16, video_size=8, stack=2)
STEPS = 4


def environment(pictures: PictureConfig = SIZES, ends_at: int | None = None) -> PixelEnvironment:
    simulator = CountingSimulator(pictures.picture_size, ends_at)
    return PixelEnvironment(simulator, pictures, action_repeat=1, episode_steps=STEPS)


class Echo:
    """Acts on what it sees: the color of the newest frame, a hundredth of it."""

    def __init__(self) -> None:
        self.seen: list[int] = []

    def __call__(self, observation: Observation) -> Action:
        self.seen.append(int(observation[0, 0, -1]))
        return np.full(2, self.seen[-1] / 100, np.float32)


def test_the_policy_sees_the_newest_frame_before_each_action() -> None:
    act = Echo()
    steps = list(rollout(environment(), act, seed=3))
    assert act.seen == [0, 1, 2, 3]
    assert [int(step.frame[0, 0, 0]) for step in steps] == [1, 2, 3, 4]
    assert [step.environment_reward for step in steps] == [2.0, 4.0, 8.0, 16.0]


def test_only_the_first_step_brings_the_frames_before_it() -> None:
    steps = list(rollout(environment(), Echo(), seed=3))
    assert steps[0].first_frames is not None
    assert [frame.shape for frame in steps[0].first_frames] == [(16, 16, 3), (8, 8, 3)]
    assert [frame.max() for frame in steps[0].first_frames] == [0, 0]
    assert [step.first_frames for step in steps[1:]] == [None] * 3


def test_an_episode_has_one_frame_more_than_actions_at_both_sizes() -> None:
    played = play_episode(environment(), Echo(), seed=3, name="first")
    episode = played.episode
    assert (episode.frames.shape, episode.frames.dtype) == ((STEPS + 1, 16, 16, 3), np.uint8)
    assert (episode.video.frames.shape, episode.video.frames.dtype) == ((STEPS + 1, 8, 8, 3), np.uint8)
    assert episode.frames[:, 0, 0, 0].tolist() == [0, 1, 2, 3, 4]
    assert episode.video.frames[:, 7, 7, 2].tolist() == [0, 1, 2, 3, 4]
    assert episode.actions.dtype == np.float32
    np.testing.assert_allclose(episode.actions, np.array([[0, 0], [1, 1], [2, 2], [3, 3]]) / 100)
    assert (episode.agent_steps, episode.terminated, episode.video.name) == (STEPS, False, "first")
    assert (played.environment_return, played.success, played.seed) == (30.0, None, 3)


def test_equal_sizes_are_stored_once() -> None:
    played = play_episode(environment(PictureConfig(8, 8)), Echo(), seed=3, name="first")
    assert played.episode.video.frames is played.episode.frames


def test_the_environments_rewards_are_kept_only_when_asked_for() -> None:
    assert play_episode(environment(), Echo(), 3, "a").episode.video.environment_rewards is None
    kept = play_episode(environment(), Echo(), 3, "a", keep_environment_rewards=True)
    rewards = kept.episode.video.environment_rewards
    assert rewards is not None
    assert (rewards.dtype, rewards.tolist()) == (np.float32, [2.0, 4.0, 8.0, 16.0])


def test_a_terminated_episode_is_shorter_and_says_so() -> None:
    played = play_episode(environment(ends_at=3), Echo(), seed=3, name="first")
    assert (played.episode.agent_steps, played.episode.terminated) == (3, True)
    assert played.success is True
    assert play_episode(environment(ends_at=1), Echo(), seed=3, name="first").success is False


def test_a_recorder_may_be_fed_one_step_at_a_time() -> None:
    recorder = EpisodeRecorder("fed")
    steps: Iterator[object] = rollout(environment(), Echo(), seed=3)
    for step in steps:
        recorder.add(step)  # type: ignore[arg-type]
    whole = play_episode(environment(), Echo(), seed=3, name="fed").episode
    np.testing.assert_array_equal(recorder.episode().frames, whole.frames)
    assert recorder.environment_return == pytest.approx(30.0)
