from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bootifol.errors import BootifolError
from bootifol.presets import CPU, DRAWN, PAPER, PRESETS
from bootifol.reports.run_files import read_run
from bootifol.training import run_config
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig, require_time_to_act


@pytest.mark.parametrize("preset", list(PRESETS))
def test_a_written_configuration_rebuilds_the_run(tmp_path: Path, preset: str) -> None:
    run = RunConfig("drawn_reach", "bootifol", preset, 3, "demos", 90.0, PRESETS[preset])  # type: ignore[index]
    run.write(tmp_path, ["bootifol", "train"])
    assert RunConfig.read(tmp_path) == run
    require_time_to_act(run.training)


def test_an_unknown_field_is_named(tmp_path: Path) -> None:
    RunConfig("drawn_reach", "bootifol", "cpu", 3, "demos", None, CPU).write(tmp_path, [])
    path = tmp_path / "config.json"
    data = json.loads(path.read_text())
    data["config"]["agent"]["telepathy"] = 1
    path.write_text(json.dumps(data))
    with pytest.raises(BootifolError, match=r"no field 'agent\.telepathy'.* go on with the version"):
        RunConfig.read(tmp_path)


def test_a_run_of_before_devices_takes_the_one_at_hand(tmp_path: Path) -> None:
    RunConfig("drawn_reach", "bootifol", "cpu", 3, "demos", None, CPU).write(tmp_path, [])
    path = tmp_path / "config.json"
    data = json.loads(path.read_text())
    del data["config"]["device"]
    path.write_text(json.dumps(data))
    assert RunConfig.read(tmp_path).training.device == "auto"


@pytest.mark.parametrize(("was", "tracker"), [(True, "tensorboard"), (False, "none")])
def test_a_run_of_before_trackers_logs_where_it_did(tmp_path: Path, was: bool, tracker: str) -> None:
    RunConfig("drawn_reach", "bootifol", "cpu", 3, "demos", None, CPU).write(tmp_path, [])
    path = tmp_path / "config.json"
    data = json.loads(path.read_text())
    del data["config"]["tracker"]
    data["config"]["tensorboard"] = was
    path.write_text(json.dumps(data))
    assert RunConfig.read(tmp_path).training == replace(CPU, tracker=tracker)


def test_a_directory_without_a_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match="is not a run"):
        RunConfig.read(tmp_path)


@pytest.mark.parametrize(
    ("place", "value", "sentence"),
    [
        (("config",), None, "must be a section, with fields of its own, not None"),
        (("config", "agent"), [], r"agent must be a section, with fields of its own, not \[\]"),
        (("config", "threads"), "two", "threads must be a whole number, not 'two'"),
        (("config", "agent", "batch_size"), 1.5, "agent.batch_size must be a whole number, not 1.5"),
        (("config", "agent", "learning_rate"), -1e-4, "agent.learning_rate must be above 0"),
        (("config", "tensorboard"), 1, "tensorboard must be true or false, not 1"),
        (("config", "tracker"), "wand", "tracker must be none, tensorboard or wandb, not 'wand'"),
        (("config", "alignment", "time_fraction"), 3.0, "alignment.time_fraction must be at most 1"),
        (("seed",), "x", "seed must be a whole number"),
        (("seed",), -1, "seed must be at least 0"),
        (("time_budget",), "60m", "time_budget must be a number"),
    ],
)
def test_what_was_edited_wrongly_is_named(
    tmp_path: Path, place: tuple[str, ...], value: object, sentence: str
) -> None:
    RunConfig("drawn_reach", "bootifol", "cpu", 3, "demos", None, CPU).write(tmp_path, [])
    path = tmp_path / "config.json"
    data = section = json.loads(path.read_text())
    for name in place[:-1]:
        section = section[name]
    section[place[-1]] = value
    path.write_text(json.dumps(data))
    with pytest.raises(BootifolError, match=sentence):
        RunConfig.read(tmp_path)


def test_a_learning_rate_lowered_by_hand_is_the_runs(tmp_path: Path) -> None:
    """What a run whose losses are not finite advises."""
    RunConfig("drawn_reach", "bootifol", "cpu", 3, "demos", None, CPU).write(tmp_path, [])
    path = tmp_path / "config.json"
    data = json.loads(path.read_text())
    data["config"]["agent"]["learning_rate"] = 0.00001
    path.write_text(json.dumps(data))
    assert RunConfig.read(tmp_path).training.agent.learning_rate == 1e-5


def test_acting_gets_half_of_a_time_budget() -> None:
    require_time_to_act(CPU)
    require_time_to_act(DRAWN)  # nothing is cloned
    greedy = replace(CPU, alignment=replace(CPU.alignment, time_fraction=0.26))
    with pytest.raises(BootifolError, match="leave less than half for acting and learning"):
        require_time_to_act(greedy)


def test_the_paper_preset_is_the_papers_table() -> None:
    """Table "Hyperparameters" and section 3; DrQ-v2's own defaults where the paper names none."""
    paper: TrainingConfig = PAPER
    reward, agent = paper.reward.bootifol, paper.agent
    assert (paper.pictures.video_size, paper.pictures.agent_size, paper.pictures.stack) == (64, 84, 3)
    assert paper.alignment.gradient_steps == 8000
    assert reward.videos_per_class == 16
    assert paper.interactive.reward_updates_until == 375_000
    assert paper.interactive.reward_update_every == 50
    assert paper.interactive.agent_steps == 1_550_000
    assert paper.interactive.agent_videos == 5000
    assert reward.learning_rate == agent.learning_rate == 1e-4
    assert (reward.reward, reward.references, reward.width_divisor, reward.frames_per_video) == (
        "distance",
        1,
        1,
        None,
    )
    assert (reward.temperature, reward.predicted_states, reward.window, reward.margin) == (0.07, 2, 2, 1.0)
    assert (agent.batch_size, agent.n_step, agent.discount, agent.hidden_dim, agent.feature_dim) == (
        256,
        3,
        0.99,
        1024,
        50,
    )
    assert (agent.exploration_start, agent.exploration_end, agent.exploration_steps) == (1.0, 0.1, 500_000)
    assert (agent.noise_clip, agent.tau, agent.update_every, agent.random_shift) == (0.3, 0.01, 2, 4)
    assert (agent.replay_capacity, agent.warm_up_steps) == (100_000, 1920)
    assert paper.demonstrations.fraction == 0 and agent.cloning_weight == 0


def test_a_run_that_goes_on_with_other_code_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    RunConfig("drawn_reach", "bootifol", "cpu", 3, "demos", None, CPU).write(tmp_path, [])
    began = read_run(tmp_path).versions
    RunConfig.note_resumed(tmp_path, 100)
    assert "resumed" not in json.loads((tmp_path / "config.json").read_text()), "nothing has changed"
    monkeypatch.setattr(run_config, "versions", lambda: began | {"code": "another"})
    for agent_steps in (200, 300):
        RunConfig.note_resumed(tmp_path, agent_steps)
    (stage,) = json.loads((tmp_path / "config.json").read_text())["resumed"]
    assert stage["agent_steps"] == 200
    assert read_run(tmp_path).versions == began | {"code": f"{began['code']}, then another"}
    assert RunConfig.read(tmp_path).seed == 3
