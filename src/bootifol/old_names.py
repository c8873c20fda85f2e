"""What fields a run's configuration had before, so that older runs are still read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

RENAMED = {
    "alignment.time_share": "time_fraction",
    "demonstrations.share": "fraction",
    "demonstrations.time_share": "time_fraction",
    "demonstrations.moving_share": "moving_fraction",
    "demonstrations.policy_share": "policy_fraction",
    "interactive.failures_share": "failures_fraction",
    "reward.bootifol.spoiled_share": "time_corrupted_fraction",
    "reward.bootifol.frames.random_share": "random_fraction",
    "reward.virl.altered_share": "altered_fraction",
}
"""Today's name in its section, by the old name with its sections."""

GONE = {"reward.bootifol.aggregate": "mean", "reward.bootifol.soft_min_temperature": 0.1}
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
