"""A run's policy acts outside of it as in its own evaluation."""

from __future__ import annotations

import runpy
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_runs import ENCODING_BASED, ENDS_SOON, PICTURES, SEEING, TINY, new_run

import bootifol
from bootifol import api
from bootifol.envs.rollout import PlayedEpisode, play_episode
from bootifol.errors import BootifolError
from bootifol.evaluation import returns
from bootifol.files import read_arrays
from bootifol.training.checkpoint import newest_checkpoint
from bootifol.training.trainer import Trainer
from bootifol.types import Episode

EXAMPLE = Path(__file__).parents[2] / "examples" / "run_a_policy.py"


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], list[Episode]]:
    """Two episodes of the library's own evaluation of a run."""

    def play(run: Path) -> list[Episode]:
        episodes: list[Episode] = []

        def noting(*arguments: Any) -> PlayedEpisode:
            one = play_episode(*arguments)
            episodes.append(one.episode)
            return one

        with monkeypatch.context() as patch:
            patch.setattr(returns, "play_episode", noting)
            api.evaluate(run, episodes=2)
        return episodes

    return play


def assert_same_actions(policy: bootifol.Policy, episodes: list[Episode]) -> None:
    assert len(episodes) == 2
    for episode in episodes:
        policy.reset()
        actions = [policy.act(frame) for frame in episode.frames[:-1]]
        np.testing.assert_array_equal(actions, episode.actions)
        assert np.ptp(actions, axis=0).min() > 0


def test_its_actions_are_those_of_the_runs_evaluation_bit_for_bit(
    finished: Path, tmp_path: Path, played: Callable
) -> None:
    episodes = played(finished)
    assert_same_actions(bootifol.load_policy(finished), episodes)
    assert_same_actions(bootifol.load_policy(str(finished / "policy.safetensors")), episodes)

    copied = shutil.copy(finished / "policy.safetensors", tmp_path / "on_a_robot.safetensors")
    alone = bootifol.load_policy(copied)
    assert_same_actions(alone, episodes)
    assert (alone.config.task, alone.config.agent_steps, alone.config.action_dim) == ("drawn_reach", 90, 2)
    assert (alone.config.frames_per_second, alone.config.action_repeat) == (10.0, 1)
    assert alone.config.pictures == PICTURES

    shutil.copytree(finished, tmp_path / "without", ignore=shutil.ignore_patterns("policy.safetensors"))
    restored = bootifol.load_policy(tmp_path / "without")
    assert_same_actions(restored, episodes)
    assert restored.config == alone.config


def test_a_policy_that_reads_states_carries_its_eyes(tmp_path: Path, demos: Path, played: Callable) -> None:
    short = replace(SEEING, interactive=replace(SEEING.interactive, agent_steps=120))
    assert new_run(tmp_path / "run", demos, config=short).learn()
    copied = shutil.copy(tmp_path / "run" / "policy.safetensors", tmp_path / "alone.safetensors")
    assert_same_actions(bootifol.load_policy(copied), played(tmp_path / "run"))


def test_it_is_a_small_part_of_the_checkpoint(finished: Path) -> None:
    newest = newest_checkpoint(finished / "checkpoints")
    assert newest is not None
    assert (finished / "policy.safetensors").stat().st_size < (
        newest / "agent.safetensors"
    ).stat().st_size / 3


def test_an_encoding_based_policy_comes_from_the_checkpoint(
    tmp_path: Path, demos: Path, played: Callable
) -> None:
    config = replace(ENCODING_BASED, interactive=replace(ENCODING_BASED.interactive, agent_steps=90))
    assert new_run(tmp_path / "run", demos, config=config).learn()
    assert not (tmp_path / "run" / "policy.safetensors").exists()
    assert_same_actions(bootifol.load_policy(tmp_path / "run"), played(tmp_path / "run"))


def test_every_checkpoint_renews_it(tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    steps: list[int] = []
    checkpoint = Trainer._checkpoint

    def noting(self: Trainer) -> None:
        checkpoint(self)
        policy = bootifol.load_policy(self.directory)
        steps.append(policy.config.agent_steps)
        arrays = read_arrays(self.directory / "policy.safetensors", "")
        state = self.parts.agent.state()
        assert all((array == state[f"averaged_{name}"]).all() for name, array in arrays.items())

    monkeypatch.setattr(Trainer, "_checkpoint", noting)
    assert new_run(tmp_path / "run", demos, config=replace(ENDS_SOON, checkpoint_minutes=1e-9)).learn()
    assert steps[0] == 0 and steps[-1] == 90 and 30 in steps


def test_where_there_is_none_a_sentence_says_so(tmp_path: Path, demos: Path) -> None:
    with pytest.raises(BootifolError, match="nowhere is not a run"):
        bootifol.load_policy(tmp_path / "nowhere")
    new_run(tmp_path / "run", demos, config=TINY)
    with pytest.raises(
        BootifolError, match="run has no checkpoint yet: let `bootifol train` write one first"
    ):
        bootifol.load_policy(tmp_path / "run")


def test_the_example_plays_an_episode(
    finished: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["run_a_policy.py", str(finished)])
    play = runpy.run_path(str(EXAMPLE), run_name="__main__")["play"]
    said = capsys.readouterr().out
    assert "drawn_reach, after 90 agent steps: 10 actions a second" in said
    assert f"return {play(str(finished)):.1f}\n" in said
    results = api.evaluate(finished, episodes=12).episodes
    assert [play(str(finished), one.seed) for one in results] == [one.environment_return for one in results]
    assert len({one.environment_return for one in results}) > 1
