"""Runs whose agent acts on encodings of the reward model; what holds for every run, other files hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from tiny_runs import ENCODING_BASED, new_run

from bootifol import api
from bootifol.agents.drqv2 import DrQv2
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.rewards.config import RewardConfig
from bootifol.training.build import build_agent, build_reward_model
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer
from bootifol.types import Action, Video

SHORT = replace(
    ENCODING_BASED,
    interactive=replace(ENCODING_BASED.interactive, agent_steps=90),
    evaluation=replace(ENCODING_BASED.evaluation, showcase_episodes=0),
)
"""A warm-up, a Cloning Phase, and an episode in which reward and agent learn."""


def test_a_finished_run_is_evaluated_with_its_own_encoder(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = new_run(tmp_path / "run", demos, config=SHORT)
    assert run.learn()
    actions: list[Action] = []
    act = DrQv2.act

    def watched(*arguments: Any, **options: Any) -> Action:
        actions.append(act(*arguments, **options))
        return actions[-1]

    monkeypatch.setattr(DrQv2, "act", watched)
    run.finish()
    finals = np.stack(actions)
    actions.clear()
    api.evaluate(tmp_path / "run", SHORT.evaluation.final_episodes, seed=run.config.seed)
    assert len(np.unique(finals, axis=0)) > 10
    np.testing.assert_array_equal(np.stack(actions), finals)


def test_the_encoder_is_taught_by_the_reward_alone(tmp_path: Path, demos: Path) -> None:
    run = new_run(tmp_path / "run", demos, config=ENCODING_BASED)
    model, agent, rng = run.parts.reward_model, run.parts.agent, np.random.default_rng(0)
    run.interactive.play_episode()
    before = model.state()
    agent.update(run.parts.replay.sample(8, rng), 0)
    for name, array in model.state().items():
        np.testing.assert_array_equal(array, before[name], err_msg=name)


def test_replay_gives_whole_pictures(tmp_path: Path, demos: Path) -> None:
    run = new_run(tmp_path / "run", demos, config=ENCODING_BASED)
    assert run.parts.replay.shift == 0
    assert run.parts.demonstrations is not None
    assert run.parts.demonstrations.replay.shift == 0


def test_a_method_without_encodings_is_refused(tmp_path: Path, demos: Path) -> None:
    with pytest.raises(BootifolError, match=r"which environment does not: choose --method bootifol"):
        new_run(tmp_path / "run", demos, "environment", ENCODING_BASED)


def test_pictures_too_small_to_encode_are_refused(demos: Path) -> None:
    config = replace(ENCODING_BASED, pictures=PictureConfig(agent_size=16, video_size=32))
    run = RunConfig("drawn_reach", "bootifol", "smoke", 1, str(demos), None, config)
    with pytest.raises(BootifolError, match=r"16 pixels.*reads 32: pass --pictures\.agent-size 32"):
        build_agent(run, None, build_reward_model(run))  # type: ignore[arg-type]


def test_encodings_of_a_backbone_are_refused(demos: Path, tiny_backbone: str) -> None:
    reward = RewardConfig(replace(ENCODING_BASED.reward.bootifol, backbone=tiny_backbone))
    run = RunConfig(
        "drawn_reach", "bootifol", "smoke", 1, str(demos), None, replace(ENCODING_BASED, reward=reward)
    )
    with pytest.raises(BootifolError, match=r"encodings does not go with a backbone"):
        build_agent(run, None, build_reward_model(run))  # type: ignore[arg-type]


def test_without_an_alignment_phase_the_reward_is_still_finite(tmp_path: Path, demos: Path) -> None:
    config = replace(SHORT, alignment=replace(SHORT.alignment, gradient_steps=0))
    run = Trainer(
        RunConfig("drawn_reach", "bootifol", "smoke", 1, str(demos), None, config),
        tmp_path / "run",
        Console(quiet=True),
    )
    assert run.learn()
    assert run.counters.alignment_steps == 0 < run.counters.reward_updates
    expert = run.parts.demos.expert
    rewards = run.parts.reward_model.label(
        Video("agent", expert[0].frames), [expert[index] for index in range(8)]
    )
    assert np.isfinite(rewards).all()
