"""Configurations of older runs have today's names once they are read."""

from __future__ import annotations

import dataclasses
from typing import Any

from bootifol.old_names import RENAMED, with_todays_names
from bootifol.training.config import TrainingConfig


def test_nested_and_dotted_fields_are_renamed_and_others_stay() -> None:
    old: dict[str, Any] = {
        "demonstrations": {"share": 0.25, "videos": 3},
        "reward.bootifol.frames.random_share": 0.5,
        "share": 1,
    }
    assert with_todays_names(old) == {
        "demonstrations": {"fraction": 0.25, "videos": 3},
        "reward.bootifol.frames.random_fraction": 0.5,
        "share": 1,
    }


def test_what_is_gone_is_left_out_where_it_said_what_is_done_today() -> None:
    old = {"reward": {"bootifol": {"aggregate": "mean", "soft_min_temperature": 0.1, "margin": 1.0}}}
    assert with_todays_names(old) == {"reward": {"bootifol": {"margin": 1.0}}}
    other = {"reward": {"bootifol": {"aggregate": "min"}}}
    assert with_todays_names(other) == other, "which the configuration then refuses by name"


def test_every_new_name_is_a_field_and_no_old_one_is() -> None:
    for old, new in RENAMED.items():
        *sections, name = old.split(".")
        config: Any = TrainingConfig()
        for section in sections:
            config = getattr(config, section)
        names = {field.name for field in dataclasses.fields(config)}
        assert new in names and name not in names, old
