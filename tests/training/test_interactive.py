"""When the reward learns while the agent acts, from what, and which stored rewards are renewed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from tiny_runs import TINY, new_run

from bootifol.agents.drqv2 import DrQv2
from bootifol.rewards.registry import METHODS
from bootifol.training import build
from bootifol.training.trainer import Trainer
from bootifol.types import Action, Arrays, Metrics, Observation, Rewards, Video, VideoSource

CONFIG = replace(TINY, interactive=replace(TINY.interactive, reward_updates_until=150))
"""240 agent steps, the first 60 of which warm up; an update of the reward every 40."""

UPDATES_AT = {
    "bootifol": [80, 120],
    "virl": [80, 120, 160, 200, 240],
    "context_translation": [],
    "gaifo": [80, 120, 160, 200, 240],
    "environment": [],
}
"""Agent steps at which the reward learns: until N_train, or to the end as in the method's own paper, or never."""


@pytest.mark.parametrize("method", list(METHODS))
def test_the_reward_learns_as_long_as_its_paper_says(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    run = new_run(tmp_path / "run", demos, method, CONFIG)
    renewed_at: list[int] = []
    monkeypatch.setattr(run.parts.replay, "relabel", lambda *_: renewed_at.append(run.counters.agent_steps))
    while not run.budget.ended(run.counters):
        run.interactive.play_episode()
    assert renewed_at == UPDATES_AT[method]  # and rewards that are not stale are left alone
    assert run.counters.reward_updates == run.parts.reward_model.version == len(UPDATES_AT[method])


class EndsEarly(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Terminates after 4, 5, ... 9 steps in turn."""

    episodes = 0

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        self.episodes, self.steps_left = self.episodes + 1, 4 + self.episodes % 6
        return self.env.reset(**options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self.env.step(action)
        self.steps_left -= 1
        return observation, reward, terminated or self.steps_left == 0, truncated, info


@pytest.mark.parametrize("method", ["bootifol", "virl", "gaifo"])
def test_rewards_of_episodes_that_ended_early_are_renewed_at_their_own_length(
    tmp_path: Path, demos: Path, method: str
) -> None:
    config = replace(CONFIG, interactive=replace(CONFIG.interactive, relabel_episodes=6))
    run = new_run(tmp_path / "run", demos, method, config)
    run.interactive.environment = EndsEarly(run.parts.environment)
    while run.counters.reward_updates < 2:
        run.interactive.play_episode()
    replay = run.parts.replay
    assert {replay.agent_steps_of(episode) for episode in replay.episode_ids} == {4, 5, 6, 7, 8, 9}


class KnownReward:
    """Rewards every step of a video with its number, and 100 for each gradient step so far."""

    reads_environment_reward = False
    keeps_learning = True
    reference_count = 2

    def __init__(self) -> None:
        self.version = 0
        self.learned_from: list[tuple[str, str]] = []
        self.compared_with: set[str] = set()

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        while True:
            yield self.update(expert, other)

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        self.learned_from.append((kind(expert[0]), kind(agent[0])))
        self.version += 1
        return {}

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        self.compared_with |= {kind(reference) for reference in references}
        return np.full(len(video.frames) - 1, 100 * self.version + number(video.name), np.float32)

    def state(self) -> Arrays:
        return {"version": np.array([self.version])}

    def load_state(self, arrays: Arrays) -> None:
        raise NotImplementedError


def kind(video: Video) -> str:
    return video.name.rpartition("-")[0]


def number(name: str) -> int:
    return int(name.rpartition("-")[2])


@pytest.fixture
def known_reward(monkeypatch: pytest.MonkeyPatch) -> KnownReward:
    """What runs learn with in this test."""
    model = KnownReward()
    monkeypatch.setattr(build, "build_reward_model", lambda _: model)
    return model


STEPS = 30
"""Of an episode."""

MANY_EPISODES = replace(
    CONFIG,
    agent=replace(CONFIG.agent, n_step=1, replay_capacity=9 * (STEPS + 1), update_every=45),
    interactive=replace(
        CONFIG.interactive, agent_steps=12 * STEPS, agent_videos=4, relabel_episodes=3, reward_update_every=50
    ),
)
"""Twelve episodes, of which replay keeps nine and the ring of videos four."""


def stored_rewards(run: Trainer) -> dict[int, float]:
    """The reward that replay holds for each episode, at all of its steps."""
    replay = run.parts.replay
    batch = replay.sample(len(replay), np.random.default_rng(0), transitions=np.arange(len(replay)))
    by_episode = batch.reward.numpy().reshape(-1, STEPS)
    assert (by_episode == by_episode[:, :1]).all()
    return dict(zip(replay.episode_ids, by_episode[:, 0].tolist(), strict=True))


def test_stored_rewards_are_those_of_their_episode(
    tmp_path: Path, demos: Path, known_reward: KnownReward
) -> None:
    run = new_run(tmp_path / "run", demos, config=MANY_EPISODES)
    stored: dict[int, float] = {}
    renewed: set[int] = set()
    while not run.budget.ended(run.counters):
        run.interactive.play_episode()
        before, stored = stored, stored_rewards(run)
        newest = run.counters.episodes - 1
        assert stored[newest] == 100 * known_reward.version + newest
        changed = {episode for episode in before.keys() & stored.keys() if stored[episode] != before[episode]}
        # While it was played, the ring did not have the newest episode's video yet.
        assert changed <= set(range(newest - 4, newest))
        assert {stored[episode] for episode in changed} <= {100 * known_reward.version + n for n in changed}
        assert all(stored[episode] % 100 == episode for episode in stored)
        renewed |= changed
    assert len(renewed) > 4
    assert known_reward.compared_with == {"drawn_reach-expert"}


def test_the_reward_hears_of_the_expert_first_and_the_agent_explores_on_schedule(
    tmp_path: Path, demos: Path, known_reward: KnownReward, monkeypatch: pytest.MonkeyPatch
) -> None:
    acted: list[tuple[float, bool]] = []
    act = DrQv2.act

    def watched(self: DrQv2, observation: Observation, agent_steps: float, explore: bool) -> Action:
        acted.append((agent_steps, explore))
        return act(self, observation, agent_steps, explore)

    monkeypatch.setattr(DrQv2, "act", watched)
    config = replace(CONFIG, evaluation=replace(CONFIG.evaluation, every=1000, held_out_videos=0))
    assert new_run(tmp_path / "run", demos, config=config).learn()
    expert, random = "drawn_reach-expert", "drawn_reach-random"
    assert known_reward.learned_from == [(expert, random)] * 4 + [(expert, "agent")] * 5
    assert acted == [(step, True) for step in range(60, 240)]
