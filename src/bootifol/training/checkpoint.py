"""Checkpoints: everything a run is, in safetensors and JSON, whole or absent.

```
checkpoints/
  000000000000-000000400/    agent steps, and steps of the other phases: names sort by age
    checkpoint.json          counters, random state, how long metrics.jsonl was
    episode.safetensors      the part that was played of an episode, where the run stopped within one
    reward_model.safetensors    networks, optimizer, statistics, random state
    agent.safetensors
    replay.safetensors
    agent_videos.safetensors
```

A new checkpoint is complete under its own name before older ones are removed, so a full disk or a lost
process leaves the last good one. Every file has a checksum, which loading it compares.
"""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from bootifol.errors import BootifolError, shortened
from bootifol.files import (
    last_whole,
    read_arrays,
    read_json,
    remove_leftovers,
    write_arrays,
    write_json,
    written_aside,
)
from bootifol.training.budget import Counters
from bootifol.types import Arrays

FORMAT = 2
_NAME = re.compile(r"\d{12}-\d{9}")
"""Of a checkpoint's directory; whatever else lies beside it is somebody's own."""
_PUT_ASIDE = re.compile(r"\.(\d{12}-\d{9})\.[0-9a-f]{8}\.old")


class Stateful(Protocol):
    """A component that can be written to a checkpoint and read back exactly."""

    def state(self) -> Arrays: ...

    def load_state(self, arrays: Arrays) -> None: ...


@dataclass(frozen=True)
class Progress:
    """Where a run stood: the part of a checkpoint that is not arrays."""

    counters: Counters
    random_state: dict[str, Any]
    """Of the run's `np.random.Generator`."""
    metrics_bytes: int
    """Length of `metrics.jsonl`; what was appended later is undone on resuming."""


def save_checkpoint(directory: Path, progress: Progress, components: Mapping[str, Stateful]) -> Path:
    """Writes a checkpoint under `directory`, then removes older ones.

    Raises:
        BootifolError: it could not be written; earlier checkpoints are intact.
    """
    counters = progress.counters
    other_steps = counters.alignment_steps + counters.cloning_steps
    target = directory / f"{counters.agent_steps:012d}-{other_steps:09d}"
    with written_aside(target) as aside:
        aside.mkdir()
        for name, component in components.items():
            write_arrays(aside / f"{name}.safetensors", component.state())
        write_json(
            aside / "checkpoint.json",
            {
                "format": FORMAT,
                "counters": counters.as_json(),
                "random_state": progress.random_state,
                "metrics_bytes": progress.metrics_bytes,
            },
            sealed=True,
        )
    for older in _checkpoints(directory):
        if older != target:
            shutil.rmtree(older, ignore_errors=True)
    remove_leftovers(directory)  # a process that was killed while it wrote could not
    return target


def newest_checkpoint(directory: Path) -> Path | None:
    """The newest complete checkpoint under `directory`, or None."""
    found = _checkpoints(directory)
    return found[-1] if found else None


def load_checkpoint(checkpoint: Path, components: Mapping[str, Stateful]) -> Progress:
    """Restores components from a checkpoint; those not named are left in the file.

    Raises:
        BootifolError: a file is missing, truncated or does not fit the configuration.
    """
    meta = read_json(checkpoint / "checkpoint.json", "the checkpoint's index")
    if isinstance(meta, dict) and meta.get("format", FORMAT) != FORMAT:
        raise BootifolError(
            f"{checkpoint} was written in checkpoint format {shortened(meta['format'])}, this version reads {FORMAT}; "
            "resume it with the version named in the run's config.json"
        )
    try:
        progress = Progress(
            Counters(**meta["counters"]),
            dict(restore_generator(meta["random_state"]).bit_generator.state),
            meta["metrics_bytes"],
        )
        _check_counts(progress)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise BootifolError(
            f"{checkpoint / 'checkpoint.json'} is damaged or of another version of bootifol: {shortened(str(error))}; "
            "resume with the version named in the run's config.json"
        ) from error
    for name, component in components.items():
        arrays = read_arrays(checkpoint / f"{name}.safetensors", f"the checkpoint's {name}")
        try:
            component.load_state(arrays)
        except (KeyError, ValueError, RuntimeError, TypeError, IndexError, OverflowError) as error:
            raise BootifolError(
                f"the checkpoint's {name} does not fit this run's configuration: {checkpoint}: {error}"
            ) from error
    return progress


def restore_generator(random_state: dict[str, Any]) -> np.random.Generator:
    """A generator that continues where the saved one stood."""
    generator = np.random.default_rng()
    generator.bit_generator.state = random_state
    return generator


def _check_counts(progress: Progress) -> None:
    """Refuses counts that cannot be."""
    for field in fields(Counters):
        value, whole = getattr(progress.counters, field.name), field.type == "int"
        if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
            raise ValueError(f"{field.name} is {shortened(value)}")
        if not 0 <= value < 2**63 or not math.isfinite(value):
            raise ValueError(f"{field.name} is {shortened(value)}")
    size = progress.metrics_bytes
    if isinstance(size, bool) or not isinstance(size, int) or not 0 <= size < 2**63:
        raise ValueError(f"metrics_bytes is {shortened(size)}")


def _checkpoints(directory: Path) -> list[Path]:
    """From the oldest to the newest; one that was being replaced by a newer of its name is found where it was put."""
    if not directory.is_dir():
        return []
    names = {path.name for path in directory.iterdir() if path.is_dir()}
    names |= {match[1] for name in names if (match := _PUT_ASIDE.fullmatch(name)) is not None}
    return [last_whole(directory / name) for name in sorted(names) if _NAME.fullmatch(name)]
