"""One way to play an episode, for training, evaluation and recording alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np

from bootifol.types import Action, Episode, Frame, Observation, Video

Act = Callable[[Observation], Action]
"""Chooses an action from an observation."""


@dataclass(frozen=True)
class Step:
    """One agent step, and what was seen after it."""

    action: Action
    frame: Frame
    """Newest frame at the agent's size, after the action."""
    video_frame: Frame
    """The same at the reward model's size."""
    first_frames: tuple[Frame, Frame] | None
    """At the first step of an episode, the two frames seen before the action; afterwards None."""
    environment_reward: float
    """For evaluation only."""
    terminated: bool
    success: bool | None


def rollout(environment: gymnasium.Env[Any, Any], act: Act, seed: int) -> Iterator[Step]:
    """Plays one episode from the start that `seed` draws."""
    observation, info = environment.reset(seed=seed)
    first: tuple[Frame, Frame] | None = (info["frame"], info["video_frame"])
    over = False
    while not over:
        action = act(observation)
        observation, reward, terminated, truncated, info = environment.step(action)
        yield Step(
            action=action,
            frame=info["frame"],
            video_frame=info["video_frame"],
            first_frames=first,
            environment_reward=float(reward),
            terminated=terminated,
            success=info.get("success"),
        )
        first = None
        over = terminated or truncated


@dataclass
class EpisodeRecorder:
    """Collects the steps of an episode.

    Args:
        name: of the episode's video.
        keep_environment_rewards: True only for the method `environment`, the upper bound.
    """

    name: str
    keep_environment_rewards: bool = False
    steps: list[Step] = field(default_factory=list)

    def add(self, step: Step) -> None:
        self.steps.append(step)

    @property
    def environment_return(self) -> float:
        """Sum of the environment's rewards, for evaluation only."""
        return float(sum(step.environment_reward for step in self.steps))

    @property
    def success(self) -> bool | None:
        """Whether any step succeeded, where the environment says so."""
        told = [step.success for step in self.steps if step.success is not None]
        return any(told) if told else None

    def episode(self) -> Episode:
        """The episode as learners may see it."""
        first = self.steps[0].first_frames
        assert first is not None
        frames = np.stack([first[0], *(step.frame for step in self.steps)])
        same_size = first[0].shape == first[1].shape
        video_frames = (
            frames if same_size else np.stack([first[1], *(step.video_frame for step in self.steps)])
        )
        rewards = None
        if self.keep_environment_rewards:
            rewards = np.array([step.environment_reward for step in self.steps], dtype=np.float32)
        return Episode(
            frames=frames,
            actions=np.stack([step.action for step in self.steps]).astype(np.float32),
            video=Video(self.name, video_frames, rewards),
            terminated=self.steps[-1].terminated,
        )


@dataclass(frozen=True)
class PlayedEpisode:
    """An episode and how good it was."""

    episode: Episode
    environment_return: float
    success: bool | None
    seed: int


def play_episode(
    environment: gymnasium.Env[Any, Any],
    act: Act,
    seed: int,
    name: str,
    keep_environment_rewards: bool = False,
) -> PlayedEpisode:
    """Plays one episode to its end.

    Args:
        environment: from `make_environment`.
        act: the policy.
        seed: of the start.
        name: of the episode's video.
        keep_environment_rewards: True only for the method `environment`, the upper bound.
    """
    recorder = EpisodeRecorder(name, keep_environment_rewards)
    for step in rollout(environment, act, seed):
        recorder.add(step)
    return PlayedEpisode(recorder.episode(), recorder.environment_return, recorder.success, seed)
