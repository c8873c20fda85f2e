"""Fields by name: those of `bootifol.train(overrides=...)` and of configuration files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import bootifol
from bootifol.errors import BootifolError
from bootifol.presets import CPU
from bootifol.training.overrides import overridden


@pytest.mark.parametrize(
    "overrides",
    [
        {"agent.batch_size": 64, "agent.n_step": 5, "threads": 2},
        {"agent": {"batch_size": 64, "n_step": 5}, "threads": 2},
        {"agent": {"batch_size": 64}, "agent.n_step": 5, "threads": 2},
    ],
    ids=["dotted", "nested", "both"],
)
def test_fields_are_replaced_and_the_others_stay(overrides: dict[str, Any]) -> None:
    expected = replace(CPU, agent=replace(CPU.agent, batch_size=64, n_step=5), threads=2)
    assert overridden(CPU, overrides) == expected


@pytest.mark.parametrize(
    ("overrides", "sentence"),
    [
        ({"agent.batchsize": 64}, "no field 'agent.batchsize'; the nearest is agent.batch_size"),
        ({"batch_size": 64}, "no field 'batch_size'; the nearest is agent.batch_size"),
        ({"reward.bootifol": {"temprature": 1.0}}, "the nearest is reward.bootifol.temperature"),
        ({"telepathy": 1}, "no field 'telepathy' \\(`bootifol train --help-all`"),
        ({"agent": 3}, "agent is a section and cannot be 3: name its fields \\(observations, encoder"),
        ({"agent.batch_size": "many"}, "overrides: agent.batch_size must be a whole number, not 'many'"),
        ({"agent.batch_size": True}, "agent.batch_size must be a whole number, not True"),
        ({"pictures.profile": "slow"}, "pictures.profile must be fast, balanced or full"),
        ({"episode_steps": 1.5}, "episode_steps must be a whole number, not 1.5"),
        ({"agent.learning_rate": float("inf")}, "agent.learning_rate must be a finite number, not inf"),
        ({"agent.batch_size": -1}, "overrides: agent.batch_size must be at least 1"),
        ({"agent": {"batch_size": 1}, "agent.batch_size": 2}, "agent.batch_size is named twice"),
    ],
)
def test_what_cannot_be_is_a_sentence(overrides: dict[str, Any], sentence: str) -> None:
    with pytest.raises(BootifolError, match=sentence):
        overridden(CPU, overrides)


def test_train_refuses_them_before_it_writes(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match=r"overrides: there is no field 'agent.batchsize'"):
        bootifol.train("drawn_reach", tmp_path, tmp_path / "run", overrides={"agent.batchsize": 64})
    assert not (tmp_path / "run").exists()


def test_a_preset_by_name_is_what_the_command_line_begins_with() -> None:
    assert bootifol.preset("cpu") == CPU
    assert bootifol.preset("frames", "virl") == CPU, "its reward has no eyes"
    with pytest.raises(BootifolError, match="there is no preset 'gpu'; the presets are"):
        bootifol.preset("gpu")
