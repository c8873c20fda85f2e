"""Errors that a user can act on."""

from __future__ import annotations

import math
import reprlib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

STOPPED = 130
"""Exit code of a command that was asked to stop before its end, as shells give it after Ctrl-C."""


_brief = reprlib.Repr()
_brief.maxlevel, _brief.maxstring, _brief.maxother = 3, 200, 200


LARGEST_SEED = 2**63 - 1
"""What every generator of random numbers that is seeded takes."""

LARGEST_COUNT = 10**9
"""No setting that counts something is larger."""

MOST_THREADS = 1024

LONGEST_EPISODE = 100_000
"""Agent steps; its pictures alone would take gigabytes."""


class BootifolError(Exception):
    """What was wrong, where, and what to do, in one sentence.

    The command line prints it without a traceback and exits with code 2.
    """


class EnvironmentFailed(BootifolError):  # noqa: N818
    """An environment raised an error of its own. Who acts in it is none the worse: what was learned is whole."""


def shortened(value: object) -> str:
    """A value out of somebody's file as a sentence can hold it."""
    text = _brief.repr(value)
    return text if len(text) <= 300 else f"{text[:300]}…"


def printable(text: str) -> str:
    """A sentence without what would steer a terminal, which a stranger's name in it may hold."""
    return "".join(sign if sign.isprintable() or sign in "\n\t" else f"\\x{ord(sign):02x}" for sign in text)


def is_lack_of_memory(error: BaseException) -> bool:
    """Whether an error says that an array or a tensor does not fit in memory; PyTorch's has no class of its own."""
    words = ("allocate memory", "out of memory", "Storage size calculation overflowed", "numel")
    return isinstance(error, MemoryError) or any(word in str(error) for word in words)


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


def require_at_least(minimum: float, **fields: float) -> None:
    """Refuses numbers below a minimum; infinity and NaN, too.

    Raises:
        BootifolError: names the first such field.
    """
    for name, value in fields.items():
        if not minimum <= value < math.inf:
            raise BootifolError(f"{name} must be at least {minimum}, not {shortened(value)}")


def require_at_most(maximum: float, **fields: float) -> None:
    """Refuses numbers above a maximum; NaN, too.

    Raises:
        BootifolError: names the first such field.
    """
    for name, value in fields.items():
        if not value <= maximum:
            raise BootifolError(f"{name} must be at most {maximum:,}, not {shortened(value)}")
