"""Configurations in files that people write, and runs' own `config.json`: read for `--config`, written for
`--print-config`."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from bootifol.errors import BootifolError, shortened
from bootifol.files import parsed_json, require_file
from bootifol.settings import Seed, settings
from bootifol.training.budget import parse_duration
from bootifol.training.config import TrainingConfig
from bootifol.training.overrides import field_kinds, nearest, overridden
from bootifol.training.run_config import FORMAT, todays_fields

LARGEST = 1_000_000
"""Bytes of a file above which it is no configuration."""

_BESIDE = ("task", "method", "preset", "seed", "time_budget", "demos", "out")
"""What a file may say beside the fields of `TrainingConfig`."""

_TOLD = ("format", "command", "versions", "videos", "resumed", "checksum")
"""What a run's `config.json` says of its past, which makes no other run."""


@dataclass(frozen=True)
@settings("")
class ConfigFile:
    """What a file says; None where it says nothing."""

    task: str | None = None
    method: str | None = None
    preset: str | None = None
    seed: Seed | None = None
    time_budget: str | None = None
    """As it is typed, such as 90m."""
    demos: str | None = None
    out: str | None = None
    fields: Mapping[str, Any] = field(default_factory=dict)
    """Of `TrainingConfig`, nested or dotted, for `overridden`, which checks them."""
    of_a_run: bool = False
    """Whether it is a run's `config.json`: a field that it lacks was not there when the run began."""

    def configured(self, preset: TrainingConfig, where: str) -> TrainingConfig:
        """The preset with the file's fields; of a run's file those alone, with defaults, as resuming reads it.

        Raises:
            BootifolError: a field cannot be what the file says.
        """
        return overridden(TrainingConfig() if self.of_a_run else preset, self.fields, where)


def read_config_file(path: Path) -> ConfigFile:
    """Reads a whole or partial configuration: JSON where the name ends in .json, else YAML.

    Names as on the command line, with underscores: `task`, `method`, `preset`, `seed`, `time_budget`, `demos`, `out`
    and every field of a run, dotted or nested. A run's `config.json`, which nests them in `config`, is one.

    Raises:
        BootifolError: it cannot be read, or names something that there is not, or gives it a value it cannot have.
    """
    data = _parsed(path)
    of_a_run = "format" in data
    if of_a_run and data["format"] != FORMAT:
        raise BootifolError(
            f"{path} is of format {shortened(data['format'])}, and this version reads {FORMAT}: use the version that "
            "wrote it"
        )
    inner = data.pop("config", None) or {}
    if not isinstance(inner, dict):
        raise BootifolError(f"{path}: config holds the fields of a run and cannot be {shortened(inner)}")
    known = [*_BESIDE, *field_kinds()]
    fields = dict(todays_fields(inner, path))
    said: dict[str, Any] = {}
    for name, value in todays_fields(data, path).items():
        if name in _TOLD:
            continue
        if name not in _BESIDE:
            if str(name).partition(".")[0] not in field_kinds():
                raise BootifolError(f"{path}: there is no field {shortened(name)}{nearest(str(name), known)}")
            if name in fields:
                raise BootifolError(f"{path}: {name} stands both in config and beside it: leave one out")
            fields[name] = value
        elif value is not None:
            said[name] = value
    if "time_budget" in said:
        said["time_budget"] = _duration(said["time_budget"], path)
    try:
        return ConfigFile(**said, fields=fields, of_a_run=of_a_run)
    except BootifolError as error:
        raise BootifolError(f"{path}: {error}") from error


def config_text(
    training: TrainingConfig,
    *,
    task: str | None,
    method: str,
    preset: str,
    seed: int,
    time_budget: str | None,
    demos: str | None,
    out: str | None,
) -> str:
    """A whole configuration as YAML that `read_config_file` reads back."""
    run = {"task": task, "method": method, "preset": preset, "seed": seed, "time_budget": time_budget}
    places = {name: place for name, place in (("demos", demos), ("out", out)) if place is not None}
    whole = run | places | dataclasses.asdict(training)
    text: str = yaml.safe_dump(whole, sort_keys=False, allow_unicode=True)
    return text


def _duration(value: object, path: Path) -> str:
    """A time budget as it is typed; a run's `config.json` has seconds."""
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        raise BootifolError(f"{path}: time_budget cannot be {shortened(value)}")
    text = value if isinstance(value, str) else f"{value!r}".removesuffix(".0") + "s"
    try:
        parse_duration(text)
    except BootifolError as error:
        raise BootifolError(f"{path}: time_budget: {error}") from error
    return text


def _parsed(path: Path) -> dict[str, Any]:
    try:
        require_file(path, "the configuration")
        if path.stat().st_size > LARGEST:
            raise ValueError(f"it has {path.stat().st_size:,} bytes, more than any configuration")
        text = path.read_text(encoding="utf-8")
        data = parsed_json(text) if path.suffix == ".json" else yaml.load(text, YamlLoader)
    except FileNotFoundError:
        raise BootifolError(f"the configuration is missing: there is no {path}") from None
    except RecursionError:
        raise BootifolError(f"{path} cannot be read: it is nested too deeply") from None
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise BootifolError(f"{path} cannot be read: {' '.join(str(error).split())}") from error
    if not isinstance(data, dict) or not data:
        raise BootifolError(
            f"{path} holds {shortened(data)} and no configuration: write fields such as `agent: {{batch_size: 64}}`"
        )
    return data


class YamlLoader(yaml.SafeLoader):  # type: ignore[misc]
    """YAML that makes nothing but texts, numbers, lists and mappings, and in which 1e-4 is a number."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """Refuses a name that comes twice, of which YAML takes the last.

        Raises:
            yaml.constructor.ConstructorError: see there.
        """
        names = [key.value for key, _ in node.value if key.value != "<<"]
        for name in names:
            if names.count(name) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f"{name} stands there twice", node.start_mark
                )
        made: dict[Hashable, Any] = super().construct_mapping(node, deep)
        return made


YamlLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?[0-9][0-9_]*(?:\.[0-9_]*)?[eE][-+]?[0-9]+$"),
    list("-+0123456789"),
)
