"""In which order pictures of a folder follow each other, by the numbers in their names."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path

from bootifol.errors import warn

_INTEGERS = re.compile(r"(\d+)")

# A point (or a comma, as half of Europe writes it) between digits, and none before or after: no date, no version.
_DECIMALS = re.compile(r"(?<![\d.,])(\d+[.,]\d+)(?![.,]?\d)")

_WHOLE_NAME = re.compile(r"[-+]?\d+([.,]\d+)?(e[-+]?\d+)?", re.IGNORECASE)

Key = list[tuple[int | Decimal, str]]
"""Exact numbers: nanoseconds since 1970 do not fit into a float."""


def natural_order(path: Path) -> Key:
    """A key for sorting: `frame2` comes before `frame10`."""
    return _key(path, _INTEGERS)


def in_order(pictures: Sequence[Path]) -> list[Path]:
    """Pictures of one folder in natural order of their names, `12.5` being a number with a decimal or two numbers.

    Both readings mostly agree. Where they do not, times with dropped zeros (`12.5` after `12.25`) are told from
    counters (`12.10` after `12.9`), and a `BootifolWarning` says which order was taken; another one where names hold
    no numbers or one number twice.
    """
    if len(pictures) < 2:
        return list(pictures)
    folder = pictures[0].parent
    by_integers = sorted(pictures, key=natural_order)
    if all(_WHOLE_NAME.fullmatch(path.stem) for path in pictures):
        by_decimals = sorted(pictures, key=lambda path: (_number(path.stem), path.name))
    else:
        by_decimals = sorted(pictures, key=lambda path: _key(path, _DECIMALS))
    ordered = by_integers
    if by_integers != by_decimals:
        counters = _counters(pictures)
        ordered = by_integers if counters else by_decimals
        warn(
            f"its pictures were taken in the order {_shown(ordered)}, their names for "
            f"{'two counters' if counters else 'decimal numbers'}; rename them if that is wrong",
            folder,
        )
    if not any(_INTEGERS.search(path.stem) for path in pictures):
        warn(
            f"no numbers in the names of its pictures: they were taken by the alphabet, {_shown(ordered)}",
            folder,
        )
    elif len({path.stem.lower() for path in pictures}) < len(pictures):
        warn("some of its pictures differ in their suffix alone: are they there twice?", folder)
    return ordered


def _key(path: Path, numbers: re.Pattern[str]) -> Key:
    """Text and numbers in turn, beginning with text."""
    key: Key = []
    # With decimals, what is left between them still holds integers.
    for place, part in enumerate(numbers.split(path.stem.lower())):
        if place % 2:
            key.append((_number(part), ""))
        else:
            for inner, text in enumerate(_INTEGERS.split(part)):
                key.append((int(text), "") if inner % 2 else (-1, text))
    return [*key, (-1, path.name)]


def _number(text: str) -> Decimal:
    return Decimal(text.replace(",", "."))


def _counters(pictures: Sequence[Path]) -> bool:
    """Whether what follows the points in names counts on its own: 9, 10, 11, or with zeros kept at the end."""
    tails = defaultdict(set)
    for path in pictures:
        found = _DECIMALS.search(path.stem)
        if found:
            head, tail = re.split("[.,]", found[1])
            tails[path.stem[: found.start()], head].add(tail)
    every = [tail for group in tails.values() for tail in group]
    if len({len(tail) for tail in every}) < 2:
        return False  # of one width: both readings agree
    if any(tail.endswith("0") and tail != "0" for tail in every):
        return True
    if any(len(tail) > 1 and tail.startswith("0") for tail in every):
        return False
    numbers = [sorted(map(int, group)) for group in tails.values()]
    return all(group[-1] - group[0] == len(group) - 1 for group in numbers)


def _shown(pictures: Sequence[Path]) -> str:
    return ", ".join(path.name for path in pictures[:3]) + (" …" if len(pictures) > 3 else "")
