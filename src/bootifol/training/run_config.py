"""`config.json`: what a run is, in a form that rebuilds it."""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bootifol.checksums import is_as_written
from bootifol.errors import BootifolError, shortened
from bootifol.files import read_json, write_json
from bootifol.old_names import with_todays_names
from bootifol.plugins import require_trust
from bootifol.settings import Number, Seed, as_settings, settings
from bootifol.tasks import Task, task_named
from bootifol.training.config import TrainingConfig
from bootifol.training.provenance import versions, videos_in

FORMAT = 1
MOST_BEFORE_ACTING = 0.5
"""Of a time budget, for alignment and cloning together."""


@dataclass(frozen=True)
@settings("")
class RunConfig:
    """Everything that determines a run."""

    task: str
    method: str
    preset: str
    seed: Seed
    demos: str
    """Directory of the demo sets."""
    time_budget: Number | None
    """Seconds of wall-clock time for learning, or None for the preset's agent steps."""
    training: TrainingConfig

    def resolved_task(self) -> Task:
        """The task with the lengths that this run gives its episodes."""
        config = self.training
        return task_named(self.task, config.action_repeat, config.episode_steps, config.evaluation_steps)

    def write(self, directory: Path, command: list[str]) -> None:
        """Writes `config.json`, with what else the run's numbers depend on: versions, code, processor, videos."""
        write_json(
            directory / "config.json",
            {
                "format": FORMAT,
                "task": self.task,
                "method": self.method,
                "preset": self.preset,
                "seed": self.seed,
                "demos": self.demos,
                "time_budget": self.time_budget,
                "command": command,
                "config": dataclasses.asdict(self.training),
                "versions": versions(),
                "videos": videos_in(Path(self.demos)),
            },
            sealed=True,
        )

    @staticmethod
    def note_resumed(directory: Path, agent_steps: int) -> None:
        """Adds to `config.json` what goes on with the run, if it is not what it has been until now."""
        path = directory / "config.json"
        data = read_json(path, "the run's configuration", editable=True)
        found = data.get("resumed", [])
        stages = [stage for stage in found if isinstance(stage, dict)] if isinstance(found, list) else []
        if (stages[-1] if stages else data).get("versions") != (now := versions()):
            data["resumed"] = [*stages, {"agent_steps": agent_steps, "versions": now}]
            write_json(path, data, sealed=True)

    @staticmethod
    def videos_of(directory: Path) -> dict[str, Any]:
        """Number and digest of the videos that a run began with, by who performs; empty for old runs."""
        data = read_json(directory / "config.json", "the run's configuration", editable=True)
        videos = data.get("videos") if isinstance(data, dict) else None
        return {
            behavior: {"count": told["count"], "digest": told["digest"]}
            for behavior, told in (videos if isinstance(videos, dict) else {}).items()
            if isinstance(told, dict) and told.keys() >= {"count", "digest"}
        }

    @classmethod
    def read(cls, directory: Path, trust: bool = False, needs_method: bool = True) -> RunConfig:
        """Reads `config.json`.

        Args:
            directory: of the run.
            trust: whether code that it names (a task or a method `MODULE:NAME`) may be imported.
            needs_method: False for who acts and rewards nothing: the method is not imported then, unless the agent acts
                on its encodings.

        Raises:
            BootifolError: it is missing, damaged, of another format, or names code that is not trusted.
        """
        path = directory / "config.json"
        if not path.is_file():
            raise BootifolError(f"{directory} is not a run: there is no {path}")
        data = read_json(path, "the run's configuration", editable=True)
        if not is_as_written(path):
            print(f"{path} was changed since bootifol wrote it, and is used as it is now", file=sys.stderr)
        if not isinstance(data, dict) or data.get("format") != FORMAT:
            raise BootifolError(
                f"{path} is not a configuration in format {FORMAT}; was it written by bootifol?"
            )
        fields = {field.name: data[field.name] for field in dataclasses.fields(cls) if field.name in data}
        try:
            training = as_settings(TrainingConfig, todays_fields(data.get("config"), path))
            run = as_settings(cls, fields | {"training": training})
        except BootifolError as error:
            raise BootifolError(
                f"{path}: {error}; restore the file, go on with the version that made the run, or start a new one"
            ) from error
        require_trust(path, "task", run.task, trust)
        if needs_method or run.training.agent.observations == "encodings":
            require_trust(path, "method", run.method, trust)
        return run


def require_time_to_act(config: TrainingConfig) -> None:
    """Acting and learning get half of a time budget at least, in runs that begin.

    Raises:
        BootifolError: the fractions of the other phases leave less.
    """
    alignment, cloning = config.alignment.time_fraction, config.demonstrations.time_fraction
    if config.demonstrations.fraction > 0 and alignment + cloning > MOST_BEFORE_ACTING:
        raise BootifolError(
            f"alignment.time_fraction {alignment:g} and demonstrations.time_fraction {cloning:g} of the time budget "
            "leave less than half for acting and learning: lower one of them"
        )


def todays_fields(data: Any, path: Path) -> Any:
    """A configuration's fields under today's names (`old_names.py`); `tensorboard`, true or false, became `tracker`.

    Raises:
        BootifolError: an old field has a value that it could not have.
    """
    if not isinstance(data, dict):
        return data
    data = with_todays_names(data)
    if "tensorboard" not in data:
        return data
    wanted = data["tensorboard"]
    if not isinstance(wanted, bool):
        raise BootifolError(f"{path}: tensorboard must be true or false, not {shortened(wanted)}")
    others = {name: value for name, value in data.items() if name != "tensorboard"}
    return {"tracker": "tensorboard" if wanted else "none"} | others
