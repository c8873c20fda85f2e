"""Single fields of a configuration replaced by name: `agent.batch_size`, or a section with its fields inside."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from bootifol.errors import BootifolError, shortened
from bootifol.training.config import TrainingConfig

_Section = TypeVar("_Section")


def overridden(
    config: TrainingConfig, overrides: Mapping[str, Any], where: str = "overrides"
) -> TrainingConfig:
    """The configuration with some fields replaced.

    Args:
        config: the others are its.
        overrides: values by the names that the command line gives fields, with underscores: `{"agent.batch_size": 64}`,
            or nested: `{"agent": {"batch_size": 64}}`.
        where: they stand, for sentences.

    Raises:
        BootifolError: there is no such field, with the nearest that there is, or a value is none that it can have.
    """
    values: dict[str, Any] = {}
    _collect(overrides, "", values, where)
    nested: dict[str, Any] = {}
    for name, value in values.items():
        *sections, field = name.split(".")
        inner = nested
        for section in sections:
            inner = inner.setdefault(section, {})
        inner[field] = value
    try:
        return _replaced(config, nested)
    except BootifolError as error:
        raise BootifolError(f"{where}: {error}") from error


@functools.cache
def field_kinds() -> dict[str, Any]:
    """The type of every field by its dotted name; of sections their class."""
    return _kinds_in(TrainingConfig, "")


def nearest(name: str, names: typing.Iterable[str]) -> str:
    """What a sentence says of an unknown name: which known one is nearest, if one is near."""
    known = list(names)
    ends = {other.rpartition(".")[2]: other for other in reversed(known)}
    close = difflib.get_close_matches(name, known, 1, 0.75)
    close = close or [ends[end] for end in difflib.get_close_matches(name.rpartition(".")[2], ends, 1, 0.7)]
    return f"; the nearest is {close[0]}" if close else ""


def _kinds_in(kind: type, before: str) -> dict[str, Any]:
    kinds: dict[str, Any] = {}
    for field, of in typing.get_type_hints(kind).items():
        kinds[before + field] = of
        if dataclasses.is_dataclass(of):
            kinds |= _kinds_in(typing.cast(type, of), f"{before}{field}.")
    return kinds


def _collect(overrides: Mapping[str, Any], before: str, values: dict[str, Any], where: str) -> None:
    """Puts every single field with its value into `values`, by its dotted name."""
    kinds = field_kinds()
    for key, value in overrides.items():
        name = f"{before}{key}"
        if name not in kinds:
            raise BootifolError(
                f"{where}: there is no field {shortened(name)}{nearest(name, kinds)} (`bootifol train --help-all` "
                "lists them)"
            )
        kind = kinds[name]
        if dataclasses.is_dataclass(kind):
            if not isinstance(value, Mapping):
                fields = ", ".join(field.name for field in dataclasses.fields(kind)[:3])
                raise BootifolError(
                    f"{where}: {name} is a section and cannot be {shortened(value)}: name its fields ({fields}, …)"
                )
            _collect(value, f"{name}.", values, where)
        elif isinstance(value, Mapping):
            raise BootifolError(f"{where}: {name} cannot be {shortened(value)}")
        elif values.setdefault(name, value) != value:
            raise BootifolError(f"{where}: {name} is named twice, with two values: leave one out")


def _replaced(section: _Section, values: Mapping[str, Any]) -> _Section:
    changes = {
        name: _replaced(getattr(section, name), value) if isinstance(value, Mapping) else value
        for name, value in values.items()
    }
    return dataclasses.replace(section, **changes)  # type: ignore[type-var]
