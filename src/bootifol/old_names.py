"""What fields a run's configuration had before, so that older runs are still read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

RENAMED = {
    "alignment.time_share": "time_fraction",
    "demonstrations.share": "fraction",
    "demonstrations.time_share": "time_fraction",
    "reward.bootifol.frames.random_share": "random_fraction",
}
"""Today's name in its section, by the old name with its sections."""

GONE = {
    "augmentation.blur": 0.5,
    "augmentation.brightness": 12.0,
    "augmentation.contrast": 0.1,
    "augmentation.noise": 3.0,
    "demonstrations.batch_size": 128,
    "demonstrations.cloning_learning_rate": 1e-3,
    "demonstrations.history_dropout": 0.8,
    "demonstrations.inverse_dynamics_learning_rate": 5e-4,
    "demonstrations.moving_fraction": 0.8,
    "demonstrations.moving_share": 0.8,
    "demonstrations.policy_fraction": 0.5,
    "demonstrations.policy_share": 0.5,
    "interactive.failures_fraction": 1.0,
    "interactive.failures_share": 1.0,
    "interactive.relabel_every": 100,
    "reward.bootifol.aggregate": "mean",
    "reward.bootifol.frames.hidden_dim": 128,
    "reward.bootifol.frames.precision": "fp32",
    "reward.bootifol.frames.shift": 2,
    "reward.bootifol.leak": 0.2,
    "reward.bootifol.soft_min_temperature": 0.1,
    "reward.bootifol.spoiled_share": 0.0,
    "reward.bootifol.time_corrupted_fraction": 0.0,
    "reward.context_translation.leak": 0.2,
    "reward.gaifo.leak": 0.01,
    "reward.gaifo.reward": "softplus",
    "reward.gaifo.stack": 3,
    "reward.virl.altered_fraction": 0.5,
    "reward.virl.altered_share": 0.5,
    "reward.virl.distance": "euclidean",
    "reward.virl.early_ends": True,
    "reward.virl.frame_drop": 0.05,
    "reward.virl.leak": 0.01,
    "reward.virl.margin": 1.0,
    "reward.virl.noise": 0.05,
    "reward.virl.reward": "both",
}
"""What there is no choice of any more, and what everyone had chosen. A run that had chosen otherwise is refused."""


def with_todays_names(config: Mapping[Any, Any], section: str = "") -> dict[Any, Any]:
    """A configuration, nested or dotted, with today's names; without what is gone; what is unknown stays as it is."""
    named = {}
    for name, value in config.items():
        path = f"{section}{name}"
        if path in GONE and value == GONE[path]:
            continue
        sections, dot, _ = str(name).rpartition(".")
        today = f"{sections}{dot}{RENAMED[path]}" if path in RENAMED else name
        named[today] = with_todays_names(value, f"{path}.") if isinstance(value, Mapping) else value
    return named
