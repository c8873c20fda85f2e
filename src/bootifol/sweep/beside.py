"""The files beside a run's directory, by which a sweep knows what became of it.

    OUT/TASK/METHOD[-VARIANT]/seedN           the run, as `bootifol train` writes it
    OUT/TASK/METHOD[-VARIANT]/seedN.log       what it printed, in all attempts
    OUT/TASK/METHOD[-VARIANT]/seedN.failed    the sentence it failed with, if it did
    OUT/TASK/METHOD[-VARIANT]/seedN.running   on which machine it is going on, while it is

There is no other record: what is done and what is left is read from these files.
"""

from __future__ import annotations

import socket
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from bootifol.errors import BootifolError
from bootifol.files import read_json, written_aside


def log_file(directory: Path) -> Path:
    """What a run printed, in all attempts."""
    return directory.with_name(f"{directory.name}.log")


def error_file(directory: Path) -> Path:
    """The sentence of a run that failed, until it is begun again."""
    return directory.with_name(f"{directory.name}.failed")


def place_file(directory: Path) -> Path:
    """Where a run is going on, as long as it does."""
    return directory.with_name(f"{directory.name}.running")


def note_failure(directory: Path, error: str) -> None:
    """Keeps the sentence that a run failed with."""
    with written_aside(error_file(directory)) as aside:
        aside.write_text(f"{error}\n")


@dataclass(frozen=True)
class Place:
    """Where a run is going on."""

    host: str
    node: str
    """Ray's name of the machine."""
    pid: int
    resumed: bool

    @staticmethod
    def here(pid: int, resumed: bool) -> Place:
        """On this machine; outside of Ray it has no name."""
        ray = sys.modules.get("ray")
        node = ray.get_runtime_context().get_node_id() if ray and ray.is_initialized() else ""
        return Place(socket.gethostname(), node, pid, resumed)

    @staticmethod
    def of(directory: Path) -> Place | None:
        """Of the run in a directory; None where it is not going on, or its process has not written it yet."""
        # It may be removed meanwhile, or a slow file system may have half of it.
        with suppress(OSError, TypeError, BootifolError):
            return Place(**read_json(place_file(directory), "where the run is"))
        return None
