"""Docstrings as help texts: a terminal breaks their lines elsewhere than the source does."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import re
import typing
from collections.abc import Callable
from typing import Any

import docstring_parser

_CONTINUED_LINE = re.compile(r"\n {8,}(?=\S)")
"""Where the description of an argument goes on in the next line of a docstring without its own indentation."""


def join_lines(command: Callable[..., Any]) -> None:
    """Joins the lines that tyro would keep apart, of a command's arguments and of the settings that it takes."""
    function = command.func if isinstance(command, functools.partial) else command
    function.__doc__ = _CONTINUED_LINE.sub(" ", inspect.cleandoc(function.__doc__ or ""))
    for kind in _settings_of(function):
        _join_lines_of_fields(kind)


@functools.cache
def _join_lines_of_fields(kind: type) -> None:
    """Writes what stands below each field, on one line, into the docstring of the class, where tyro looks first."""
    lines = [f"    {name}: {text}" for name, text in field_texts(kind).items()]
    kind.__doc__ = "\n".join([inspect.cleandoc(kind.__doc__ or ""), "", "Attributes:", *lines])
    for inner in _settings_of(kind):
        _join_lines_of_fields(inner)


def field_texts(kind: type) -> dict[str, str]:
    """What stands below each field of a dataclass and of those that it extends, on one line."""
    kinds = [base for base in reversed(kind.__mro__) if dataclasses.is_dataclass(base)]
    found = [field for base in kinds for field in docstring_parser.parse_from_object(base).params]
    return {field.arg_name: " ".join((field.description or "").split()) for field in found}


def _settings_of(command: Callable[..., Any]) -> list[type]:
    """The dataclasses among the arguments of a command, or among the fields of another dataclass."""
    kinds = typing.get_type_hints(command).values()
    return [kind for kind in kinds if isinstance(kind, type) and dataclasses.is_dataclass(kind)]
