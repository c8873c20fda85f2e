"""A run with a frozen backbone, from videos to a report; and again, stopped and resumed."""

from __future__ import annotations

import os
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_runs import TINY, WITH_DEMONSTRATIONS, new_run, resumed

from bootifol import api
from bootifol.evaluation.tables import read_ranking
from bootifol.networks.backbones import Backbone
from bootifol.rewards.config import RewardConfig
from bootifol.training.config import TrainingConfig
from bootifol.training.interactive import InteractivePhase
from bootifol.types import Features, Frames, StepMetrics


def with_backbone(config: TrainingConfig, name: str) -> TrainingConfig:
    return replace(config, reward=RewardConfig(replace(config.reward.bootifol, backbone=name)))


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """Every frame that a backbone has read, apart from the two it is tried with."""
    read: list[bytes] = []
    features = Backbone.features

    def counting(self: Backbone, frames: Frames) -> Features:
        read.extend(frame.tobytes() for frame in frames)
        return features(self, frames)

    monkeypatch.setattr(Backbone, "features", counting)
    return read


@pytest.fixture
def own_demos(demos: Path, tmp_path: Path) -> Path:
    """Videos whose features nobody computed yet."""
    shutil.copytree(demos, tmp_path / "demos", ignore=shutil.ignore_patterns("features"))
    return tmp_path / "demos"


FRAMES = 31
VIDEOS = 12 + 12 + 2
"""Of expert and random videos all are read, of half-good ones those that are held out."""
EPISODES = 4


def lasting(episodes: int, config: TrainingConfig) -> TrainingConfig:
    return replace(config, interactive=replace(config.interactive, agent_steps=episodes * (FRAMES - 1)))


def test_videos_to_report_with_every_frame_read_once(
    own_demos: Path, tmp_path: Path, tiny_backbone: str, counted: list[bytes]
) -> None:
    config = lasting(EPISODES, with_backbone(TINY, tiny_backbone))
    run = new_run(tmp_path / "run", own_demos, config=config)
    assert len(counted) == VIDEOS * FRAMES
    assert run.learn()
    assert len(counted) == (VIDEOS + EPISODES) * FRAMES
    run.finish()
    assert np.isfinite([row.reward for row in read_ranking(tmp_path / "run" / "ranking.csv").rows]).all()
    assert (tmp_path / "run" / "showcase.safetensors").is_file()
    counted.clear()
    scores = api.score(tmp_path / "run", [own_demos / "expert"])
    assert len(counted) == 12 * FRAMES  # those given; the references' are on disk
    assert all(len(rewards) == FRAMES - 1 and np.isfinite(rewards).all() for rewards in scores.values())


def test_another_run_finds_the_features_of_the_videos(
    own_demos: Path, tmp_path: Path, tiny_backbone: str, counted: list[bytes]
) -> None:
    config = with_backbone(TINY, tiny_backbone)
    new_run(tmp_path / "first", own_demos, config=config)
    counted.clear()
    run = new_run(tmp_path / "second", own_demos, config=config, seed=2)
    assert counted == []
    video = run.parts.agent_videos
    assert video.bytes_needed(6, FRAMES, 32, 32) == sum(
        array.nbytes for array in (video._features, video._frames)
    )


def test_a_run_stopped_and_resumed_is_the_uninterrupted_run(
    demos: Path, tmp_path: Path, tiny_backbone: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = lasting(6, with_backbone(WITH_DEMONSTRATIONS, tiny_backbone))
    whole = new_run(tmp_path / "whole", demos, config=config)
    assert whole.learn()
    play = InteractivePhase.play_episode

    def play_and_signal(self: InteractivePhase) -> list[StepMetrics]:
        if self.counters.episodes == 4:
            os.kill(os.getpid(), signal.SIGTERM)
        return play(self)

    with monkeypatch.context() as patch:
        patch.setattr(InteractivePhase, "play_episode", play_and_signal)
        assert not new_run(tmp_path / "parts", demos, config=config).learn()
    rest = resumed(tmp_path / "parts")
    assert (rest.counters.episodes, rest.interactive.steps_in_progress) == (4, 1)
    assert rest.learn()
    for name, component in whole.parts.stateful().items():
        expected, found = component.state(), rest.parts.stateful()[name].state()
        assert expected.keys() == found.keys()
        for array in expected:
            np.testing.assert_array_equal(found[array], expected[array], err_msg=f"{name}: {array}")
