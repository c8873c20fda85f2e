"""Errors that a user can act on."""

from __future__ import annotations

import math
import typing
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

STOPPED = 130
"""Exit code of a command that was asked to stop before its end, as shells give it after Ctrl-C."""


class BootifolError(Exception):
    """What was wrong, where, and what to do, in one sentence.

    The command line prints it without a traceback and exits with code 2.
    """


class BootifolWarning(UserWarning):
    """What was taken one way where another was possible, or left out: a sentence, and the file it is about.

    The command line prints it as a line that begins with `note:`.
    """

    def __init__(self, what: str, where: Path | None = None) -> None:
        super().__init__(what if where is None else f"{where}: {what}")
        self.what = what
        self.where = where


def warn(what: str, where: Path | None = None) -> None:
    """Issues a `BootifolWarning`."""
    warnings.warn(BootifolWarning(what, where), stacklevel=2)


@contextmanager
def collected_warnings() -> Iterator[list[BootifolWarning]]:
    """Yields a list that holds, after the block, every `BootifolWarning` of it; they are not shown."""
    collected: list[BootifolWarning] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", BootifolWarning)
        try:
            yield collected
        finally:
            collected += [found.message for found in caught if isinstance(found.message, BootifolWarning)]
    for found in caught:
        if not isinstance(found.message, BootifolWarning):
            warnings.warn_explicit(found.message, found.category, found.filename, found.lineno)


def fields_of(what: str, config: object, *names: str) -> dict[str, float]:
    """A configuration's numbers by the names that sentences give them; fields that are None are left out."""
    values = {f"{what}: {name}": getattr(config, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def require_at_least(minimum: float, **fields: float) -> None:
    """Refuses numbers below a minimum; infinity and NaN, too.

    Raises:
        BootifolError: names the first such field.
    """
    for name, value in fields.items():
        if not minimum <= value < math.inf:
            raise BootifolError(f"{name} must be at least {minimum}, not {value}")


def require_positive(**fields: float) -> None:
    """Refuses numbers that are not above 0; infinity and NaN, too.

    Raises:
        BootifolError: names the first such field.
    """
    for name, value in fields.items():
        if not 0 < value < math.inf:
            raise BootifolError(f"{name} must be positive, not {value}")


def require_share(**fields: float) -> None:
    """Refuses numbers outside of [0, 1].

    Raises:
        BootifolError: names the first such field.
    """
    for name, value in fields.items():
        if not 0 <= value <= 1:
            raise BootifolError(f"{name} must lie in [0, 1], not {value}")


def require_below_one(**fields: float) -> None:
    """Refuses numbers outside of [0, 1).

    Raises:
        BootifolError: names the first such field.
    """
    for name, value in fields.items():
        if not 0 <= value < 1:
            raise BootifolError(f"{name} must lie in [0, 1), not {value}")


def require_choices(of: str, config: object) -> None:
    """Refuses a value that is none of its field's choices (a Literal), which Python itself lets pass.

    Args:
        of: what the configuration is of, for the sentence.
        config: a dataclass.

    Raises:
        BootifolError: names the field and its choices.
    """
    for field, kind in typing.get_type_hints(type(config)).items():
        if typing.get_origin(kind) is typing.Literal and getattr(config, field) not in typing.get_args(kind):
            choices = " or ".join(typing.get_args(kind))
            raise BootifolError(f"{of}: {field} is {getattr(config, field)}; use {choices}")
