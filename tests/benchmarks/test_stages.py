"""Where the time of a run goes: how often each stage happens, by hand. Times are not asserted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.stages import measure, stages_of, warm_up
from rich.console import Console

from bootifol.sweep.sweep_file import read_sweep
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer

SMALL = read_sweep(Path(__file__).parents[2] / "benchmarks" / "suites" / "smoke.yaml")[0].config
CONFIG = replace(SMALL, interactive=replace(SMALL.interactive, reward_updates_until=160))


def counts(demos: Path, directory: Path, method: str, config: TrainingConfig) -> dict[str, float]:
    run = Trainer(
        RunConfig("drawn_home", method, "smoke", 1, str(demos), None, config), directory, Console(quiet=True)
    )
    warm_up(run)
    return {stage.name: stage.calls for stage in stages_of(run)}


def test_how_often_a_stage_happens_follows_from_the_configuration(demos: Path, tmp_path: Path) -> None:
    config = replace(
        CONFIG,
        agent=replace(CONFIG.agent, warm_up_steps=60, update_every=10),
        interactive=replace(CONFIG.interactive, reward_update_every=25, relabel_episodes=3),
        demonstrations=replace(
            CONFIG.demonstrations,
            videos=2,
            phases=4,
            repeat_every=90,
            inverse_dynamics_updates=7,
            cloning_updates=5,
        ),
        evaluation=replace(CONFIG.evaluation, every=120),
    )
    assert counts(demos, tmp_path, "bootifol", config) == {
        "alignment step": 4,
        "Cloning Phase: gradient step of the inverse dynamics": 14,
        "Cloning Phase: actions and rewards of 2 videos": 2,
        "Cloning Phase: gradient step of the clone": 10,
        "agent step of the environment": 240,
        "action of the agent": 180,
        "batch from replay": 18,
        "update of the agent": 18,
        "gradient step of the reward": 4,  # (160 - 60) / 25
        "renewing a stored episode's rewards": 12,
        "rewarding an episode while the reward learns": 160 / 30,
        "rewarding an episode when it rests": 80 / 30,
        "evaluation on the way": 2 + 2,  # and one after each of the Cloning Phases, at 60 and 150
        "checkpoint, each 20 minutes": 0,
    }


def test_a_method_that_learns_before_the_agent_acts_has_no_stage_of_it_later(
    demos: Path, tmp_path: Path
) -> None:
    stages = counts(demos, tmp_path, "context_translation", CONFIG)
    assert stages["rewarding an episode when it rests"] == 240 / 30
    assert not {"gradient step of the reward", "rewarding an episode while the reward learns"} & stages.keys()


def test_the_true_reward_learns_and_rewards_nothing(demos: Path, tmp_path: Path) -> None:
    assert not any("reward" in name for name in counts(demos, tmp_path, "environment", CONFIG))


def test_the_table_names_every_stage_and_the_whole(demos: Path, capsys: pytest.CaptureFixture[str]) -> None:
    measure(CONFIG, demos, "drawn_home", preset="smoke", runs=1)
    lines = capsys.readouterr().out.splitlines()
    assert lines[2].startswith("| stage | in a run | ms each | arithmetic ms | ms an agent step | fraction |")
    assert lines[4].startswith("| alignment step | 4 |")
    assert lines[-1].startswith("| all | 240 agent steps |")
