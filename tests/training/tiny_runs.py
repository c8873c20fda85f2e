"""Runs so small that a test can train several: the drawn task, 32-pixel pictures, the narrowest networks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.presets import SMOKE
from bootifol.rewards.bootifol.frames.config import FrameConfig
from bootifol.rewards.config import RewardConfig
from bootifol.rewards.registry import METHODS
from bootifol.training.config import AlignmentConfig, DemonstrationConfig, InteractiveConfig, TrainingConfig
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer

PICTURES = PictureConfig(agent_size=32, video_size=32)

TINY = replace(
    SMOKE,
    pictures=PICTURES,
    device="cpu",  # what must hold bit for bit does so there
    threads=1,
    tracker="none",
    reward=RewardConfig(
        replace(SMOKE.reward.bootifol, width_divisor=32, videos_per_class=2),
        virl=replace(SMOKE.reward.virl, width_divisor=32, videos_per_class=2),
        context_translation=replace(SMOKE.reward.context_translation, width_divisor=32, references=2),
        gaifo=replace(SMOKE.reward.gaifo, width_divisor=32, videos_per_class=2),
    ),
    agent=replace(
        SMOKE.agent,
        encoder="strided",
        hidden_dim=16,
        batch_size=8,
        warm_up_steps=60,
        warm_up_hold=1,
        cloning_weight=0.0,
        update_every=5,
        replay_capacity=600,
    ),
    alignment=AlignmentConfig(gradient_steps=4, log_every=2),
    interactive=InteractiveConfig(
        agent_steps=240,
        reward_update_every=40,
        reward_updates_until=200,
        agent_videos=6,
        relabel_episodes=1,
        log_every=60,
    ),
    demonstrations=DemonstrationConfig(),
    evaluation=replace(SMOKE.evaluation, every=120, held_out_videos=2, sight_episodes=0),
)

WITH_DEMONSTRATIONS = replace(
    TINY,
    agent=replace(TINY.agent, warm_up_hold=4, cloning_weight=1.0),
    demonstrations=DemonstrationConfig(
        fraction=0.5,
        videos=4,
        inverse_dynamics_updates=3,
        cloning_updates=4,
        phases=3,
        repeat_every=60,
    ),
)
"""The same, starting as a clone of the expert videos."""

ENCODING_BASED = replace(
    WITH_DEMONSTRATIONS, agent=replace(WITH_DEMONSTRATIONS.agent, observations="encodings")
)
"""The same, with an agent that sees the reward model's encodings instead of pictures."""

SEEING = replace(
    WITH_DEMONSTRATIONS,
    reward=replace(
        TINY.reward,
        bootifol=replace(
            TINY.reward.bootifol,
            reward="frames",
            frames=FrameConfig(videos_per_class=2, frames_per_class=8, width=4),
        ),
    ),
    agent=replace(WITH_DEMONSTRATIONS.agent, observations="states", critic_norm=True, ema_decay=0.9),
    evaluation=replace(TINY.evaluation, sight_episodes=1),
)
"""The same with a reward from single frames and an agent that reads states."""

INFERRING = replace(
    SEEING,
    agent=replace(SEEING.agent, cloning_weight=0.0),
    demonstrations=replace(SEEING.demonstrations, cloning_updates=0),
)
"""The same with the videos as experience alone: nothing is cloned."""

ENDS_SOON = replace(
    TINY,
    agent=replace(TINY.agent, ema_decay=0.9, warm_up_steps=30),
    interactive=replace(TINY.interactive, agent_steps=90),
)
"""A policy with averaged networks after a few updates."""

RUNS = [
    pytest.param("bootifol", TINY, id="paper"),
    pytest.param("bootifol", ENCODING_BASED, id="encoding_based"),
    pytest.param("bootifol", SEEING, id="frames"),
    pytest.param("bootifol", INFERRING, id="inferred_actions"),
    *(pytest.param(method, WITH_DEMONSTRATIONS, id=method) for method in METHODS),
]
"""Method and configuration of what must hold for every method: cloning asks the reward for more than acting does."""

IMITATING_RUNS = [run for run in RUNS if run.id != "environment"]
"""The same without the upper bound."""


class NoFurther(Exception):  # noqa: N818
    """Ends a run as an error does: nothing more is written."""


def no_further(*_: object) -> None:
    """In place of a phase."""
    raise NoFurther


def record_demos(directory: Path) -> Path:
    for behavior in ("expert", "random", "half_good"):
        record("drawn_reach", behavior, 12, directory / behavior, PICTURES)
    return directory


def new_run(
    directory: Path, demos: Path, method: str = "bootifol", config: TrainingConfig = TINY, seed: int = 1
) -> Trainer:
    run = RunConfig("drawn_reach", method, "smoke", seed, str(demos), None, config)
    made = Trainer(run, directory, Console(quiet=True))
    run.write(directory, ["bootifol", "train"])
    return made


def resumed(directory: Path) -> Trainer:
    return Trainer(RunConfig.read(directory), directory, Console(quiet=True))
