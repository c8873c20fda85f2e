"""Errors that a user can act on."""

from __future__ import annotations

import typing

STOPPED = 130
"""Exit code of a command that was asked to stop before its end, as shells give it after Ctrl-C."""


class BootifolError(Exception):
    """What was wrong, where, and what to do, in one sentence.

    The command line prints it without a traceback and exits with code 2.
    """


def require_at_least(minimum: float, **fields: float) -> None:
    """Refuses a configuration's numbers below a minimum; NaN too.

    Raises:
        BootifolError: names the first field that is too small.
    """
    for name, value in fields.items():
        if not value >= minimum:
            raise BootifolError(f"{name} must be at least {minimum}, not {value}")


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
