"""When the reward learns while the agent acts, and when stored rewards are renewed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from tiny_runs import TINY, WITH_DEMONSTRATIONS, new_run

from bootifol.rewards.registry import METHODS

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
    monkeypatch.setattr(
        run.components.replay, "relabel", lambda *_: renewed_at.append(run.counters.agent_steps)
    )
    while not run.budget.ended(run.counters):
        run.interactive.play_episode()
    assert renewed_at == UPDATES_AT[method]  # and rewards that are not stale are left alone
    assert run.counters.reward_updates == run.components.reward_model.version == len(UPDATES_AT[method])


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
    run.interactive.environment = EndsEarly(run.environment)
    while run.counters.reward_updates < 2:
        run.interactive.play_episode()
    replay = run.components.replay
    assert {replay.agent_steps_of(episode) for episode in replay.episode_ids} == {4, 5, 6, 7, 8, 9}


def test_demonstrations_follow_the_reward_too(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = new_run(tmp_path / "run", demos, config=WITH_DEMONSTRATIONS)
    renewed_at: list[int] = []
    assert run.components.demonstrations is not None
    monkeypatch.setattr(
        run.components.demonstrations, "reward_anew", lambda *_: renewed_at.append(run.counters.agent_steps)
    )
    assert run.learn()
    assert renewed_at == [80, 120, 160, 200], "one each time the reward learns, as of the agent's episodes"
