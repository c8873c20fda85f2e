"""Bounds of settings: a frozen dataclass says them in its annotations, pydantic checks them, and what is wrong is a
sentence."""

from __future__ import annotations

import functools
import typing
from collections.abc import Callable
from typing import Annotated, Any, Literal, TypeVar, cast

from pydantic import ConfigDict, Field, Strict, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from bootifol.errors import LARGEST_COUNT, LARGEST_SEED, MOST_THREADS, BootifolError, shortened

Count = Annotated[int, Strict(), Field(ge=1, le=LARGEST_COUNT)]
CountOrZero = Annotated[int, Strict(), Field(ge=0, le=LARGEST_COUNT)]
AtLeastTwo = Annotated[int, Strict(), Field(ge=2, le=LARGEST_COUNT)]
Seed = Annotated[int, Strict(), Field(ge=0, le=LARGEST_SEED)]
Threads = Annotated[int, Strict(), Field(ge=1, le=MOST_THREADS)]
Flag = Annotated[bool, Strict()]
Number = Annotated[float, Strict(), Field(ge=0, le=LARGEST_COUNT, allow_inf_nan=False)]
"""0 or above."""
Positive = Annotated[float, Strict(), Field(gt=0, le=LARGEST_COUNT, allow_inf_nan=False)]
Fraction = Annotated[float, Strict(), Field(ge=0, le=1, allow_inf_nan=False)]
BelowOne = Annotated[float, Strict(), Field(ge=0, lt=1, allow_inf_nan=False)]

Precision = Literal["fp32", "bf16"]

_Kind = TypeVar("_Kind")

_SENTENCES = {
    "greater_than_equal": "must be at least {ge}",
    "greater_than": "must be above {gt}",
    "less_than_equal": "must be at most {le}",
    "less_than": "must be below {lt}",
    "literal_error": "must be {expected}",
    "finite_number": "must be a finite number",
    "int_type": "must be a whole number",
    "float_type": "must be a number",
    "bool_type": "must be true or false",
    "string_type": "must be a text",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "dict_type": "must be an object",
    "dataclass_type": "must be a section, with fields of its own",
}
"""By pydantic's name of an error."""


def settings(section: str) -> Callable[[type[_Kind]], type[_Kind]]:
    """A class decorator below `@dataclass(frozen=True)`: fields are what their annotations say before `__post_init__`
    compares them.

    Args:
        section: where the fields stand, dotted as on the command line, for sentences; empty for the outermost.

    Raises:
        BootifolError: where one is made, or changed by `dataclasses.replace`, with a field that it cannot have.
    """

    def checked(kind: type[_Kind]) -> type[_Kind]:
        compare = vars(kind).get("__post_init__", lambda self: None)

        def __post_init__(self: Any) -> None:  # noqa: N807
            for name, adapter in _adapters(cast(Any, type(self))).items():
                try:
                    object.__setattr__(self, name, adapter.validate_python(getattr(self, name)))
                except ValidationError as error:
                    raise BootifolError(_sentence(error.errors()[0], section, name)) from None
            compare(self)

        kind.__post_init__ = __post_init__  # type: ignore[attr-defined]
        kind.__pydantic_config__ = ConfigDict(extra="forbid")  # type: ignore[attr-defined]
        return kind

    return checked


def as_settings(kind: type[_Kind], data: object) -> _Kind:
    """A value of a type from what JSON or YAML made of it, nested; a whole number where a fraction may be becomes one.

    Raises:
        BootifolError: a field is unknown, missing, or has a value that it cannot have; named from `data` on, dotted.
    """
    try:
        value: _Kind = _adapter(cast(Any, kind)).validate_python(data)
        return value
    except ValidationError as error:
        raise BootifolError(_sentence(error.errors()[0])) from None


@functools.cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


@functools.cache
def _adapters(kind: Any) -> dict[str, TypeAdapter[Any]]:
    """Of each field."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return {name: TypeAdapter(hint) for name, hint in hints.items()}


def _sentence(error: ErrorDetails, *above: str) -> str:
    """What is wrong first."""
    name = ".".join(str(part) for part in (*above, *error["loc"]) if part != "")
    if error["type"] == "unexpected_keyword_argument":
        return f"there is no field {shortened(name)}"
    if error["type"] == "missing":
        return f"{name} is missing"
    told = {name: _told(bound) for name, bound in error.get("ctx", {}).items()}
    expected = _SENTENCES.get(error["type"], error["msg"]).format(**told)
    return f"{name} {expected}, not {shortened(error['input'])}".strip()


def _told(bound: object) -> str:
    """A bound, or the choices that there are, as a sentence has it."""
    if isinstance(bound, float) and bound.is_integer():
        bound = int(bound)
    return f"{bound:,}" if isinstance(bound, int) else str(bound).replace("'", "")
