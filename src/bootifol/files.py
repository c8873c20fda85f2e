"""Files that are either whole or absent, written aside, synced, renamed; and what reads them, whoever wrote them."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import tokenize
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import load_file, save_file

from bootifol.checksums import BLANK, NAME, require_as_written, seal
from bootifol.errors import BootifolError
from bootifol.types import Arrays

DAMAGED_ARRAY = (ValueError, OSError, EOFError, SyntaxError, tokenize.TokenError, MemoryError, TypeError)
"""What numpy raises at a file that is no array of its own, or a damaged one: it reads headers as Python literals."""

_LARGEST_JSON = 1 << 28
"""Bytes of a JSON file above which it is none of ours; the largest, of a set of a million videos, has half of that."""
_DEEPEST = 50
"""Levels of nesting in JSON, of which ours has a handful."""
_ASIDE = re.compile(r"\.(.+)\.[0-9a-f]{8}\.(tmp|old)")
_MOST_DIGITS = 50
"""Of a whole number in JSON; the state of a random generator has 39."""


@contextmanager
def written_aside(target: Path) -> Iterator[Path]:
    """Yields a path to write to; on success syncs it and renames it to `target`.

    On any error the half-written file or directory is removed, with directories made for it, and an existing `target`
    is untouched. Of a directory that replaces another, `last_whole` finds one of the two whatever happens.

    Raises:
        BootifolError: the disk is full or not writable.
    """
    aside = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}.tmp")
    missing: list[Path] = []
    try:
        missing = [directory for directory in target.parents if not directory.exists()]
        target.parent.mkdir(parents=True, exist_ok=True)
        yield aside
        for path in [aside, *aside.rglob("*")] if aside.is_dir() else [aside]:
            _sync(path)
        if aside.is_dir() and target.is_dir():
            old = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}.old")
            target.replace(old)
            aside.replace(target)
            shutil.rmtree(old)
        else:
            aside.replace(target)
        _sync(target.parent)
    except (OSError, SafetensorError) as error:
        raise BootifolError(
            f"cannot write {target}: {error}; free some space or choose another directory "
            "(whatever was there before is untouched)"
        ) from error
    finally:
        with suppress(OSError):  # nothing can be there where nothing could be made
            if aside.is_dir():
                shutil.rmtree(aside, ignore_errors=True)
            else:
                aside.unlink(missing_ok=True)
            if not target.exists():
                for directory in missing:
                    with suppress(OSError):  # others write there by now
                        directory.rmdir()


def last_whole(directory: Path) -> Path:
    """A directory of `written_aside`, or, where a process was killed in between two renames, the one before it."""
    if directory.exists():
        return directory
    put_aside = [path for path, name in _left(directory.parent, "old") if name == directory.name]
    return max(put_aside, key=lambda path: path.stat().st_mtime, default=directory)


def remove_leftovers(directory: Path, target: Path | None = None) -> None:
    """Removes what processes that were killed had written aside in a directory, or put aside there and replaced.

    Only who knows that nobody else writes there may call it.

    Args:
        directory: where to look.
        target: the one whose leftovers are meant; by default every one's.
    """
    for path, name in [*_left(directory, "tmp"), *_left(directory, "old")]:
        if target is not None and name != target.name:
            continue
        if path.suffix == ".old" and last_whole(directory / name) == path:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink()


def write_json(target: Path, value: Any, sealed: bool = False) -> None:
    """Writes `value` as indented JSON; NaN is refused (it is not JSON).

    Args:
        target: the file.
        value: what is written.
        sealed: whether a checksum is put into it, which is then an object.
    """
    text = json.dumps({**value, NAME: BLANK} if sealed else value, indent=2, allow_nan=False) + "\n"
    with written_aside(target) as aside:
        aside.write_text(text)
        if sealed:
            seal(aside)


def read_json(path: Path, what: str, editable: bool = False) -> Any:
    """Reads JSON; without its checksum, if it has one.

    Args:
        path: the file.
        what: what the file is to the user, for the error's sentence ("the demo set's manifest").
        editable: whether people may change the file, so that its checksum says nothing.

    Raises:
        BootifolError: the file is missing, is not JSON, or its bytes are not those that its checksum is of.
    """
    with _read_errors(path, what, "cannot be read"):
        require_file(path, what)
        if path.stat().st_size > _LARGEST_JSON:
            raise ValueError(f"it has {path.stat().st_size:,} bytes, more than any that bootifol writes")
        value = parsed_json(path.read_text())
        if not editable:
            require_as_written(path, what)
    if isinstance(value, dict):
        value.pop(NAME, None)
    return value


def parsed_json(text: str, constants: bool = False) -> Any:
    """The value of a JSON text, whoever wrote it.

    Args:
        text: the JSON.
        constants: whether NaN and Infinity, which are not JSON, are taken.

    Raises:
        ValueError: it is not JSON, is nested deeper or has larger numbers than anything that bootifol writes.
    """

    def no_constant(name: str) -> NoReturn:
        raise ValueError(f"{name} is not JSON")

    try:
        value = json.loads(
            text,
            parse_constant=None if constants else no_constant,
            parse_int=_whole_number,
            parse_float=float if constants else _finite_number,
        )
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    level = [value]
    for _ in range(_DEEPEST):
        level = [
            inner
            for outer in level
            if isinstance(outer, dict | list)
            for inner in (outer.values() if isinstance(outer, dict) else outer)
        ]
        if not level:
            return value
    raise ValueError("it is nested too deeply")


def require_file(path: Path, what: str) -> None:
    """Refuses what is no file, such as a directory, or a pipe that would keep its reader waiting.

    Raises:
        FileNotFoundError: there is nothing.
        BootifolError: there is something else.
    """
    if not path.exists():
        raise FileNotFoundError(path)
    if not path.is_file():
        raise BootifolError(f"{what} cannot be read: {path} is no file; put the file there")


def write_arrays(target: Path, arrays: Arrays, texts: Mapping[str, str] | None = None) -> None:
    """Writes named arrays as one safetensors file, with named texts and a checksum in its header."""
    with written_aside(target) as aside:
        # Not np.ascontiguousarray, which gives numbers without a dimension one.
        contiguous = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        aside.touch()
        mode = aside.stat().st_mode
        save_file(contiguous, aside, {**(texts or {}), NAME: BLANK})
        seal(aside)
        aside.chmod(mode)  # safetensors lets nobody but its writer read it


def read_arrays(path: Path, what: str, verify: bool = True) -> Arrays:
    """Reads a safetensors file; nothing is unpickled.

    Args:
        path: the file.
        what: what it is to the user, for the error's sentence.
        verify: whether to compare its checksum; who does not, calls `require_as_written` before using the arrays.

    Raises:
        BootifolError: the file is missing, truncated or damaged, if only by one bit.
    """
    with _read_errors(path, what):
        require_file(path, what)
        if verify:
            require_as_written(path, what)
        return dict(load_file(path))


def read_texts(path: Path, what: str) -> dict[str, str]:
    """Reads the texts in the header of a safetensors file; empty where there are none. No checksum is compared.

    Raises:
        BootifolError: the file is missing, or its header damaged.
    """
    with _read_errors(path, what):
        require_file(path, what)
        with safe_open(path, framework="numpy") as file:
            texts = dict(file.metadata() or {})
    texts.pop(NAME, None)
    return texts


@contextmanager
def _read_errors(path: Path, what: str, how: str = "is damaged or incomplete") -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise BootifolError(f"{what} is missing: there is no {path}") from None
    except PermissionError:
        raise BootifolError(
            f"{what} must not be read by this user: {path}; ask its owner, or copy it"
        ) from None
    except MemoryError as error:
        raise BootifolError(f"{what} does not fit in this machine's memory: {path}") from error
    except (OSError, SafetensorError, ValueError, TypeError, OverflowError) as error:
        raise BootifolError(f"{what} {how}: {path}: {error}") from error


def _left(directory: Path, kind: str) -> list[tuple[Path, str]]:
    """What `written_aside` wrote or put aside in a directory, and the name it was for."""
    if not directory.is_dir():
        return []
    matches = ((path, _ASIDE.fullmatch(path.name)) for path in sorted(directory.iterdir()))
    return [(path, match[1]) for path, match in matches if match is not None and match[2] == kind]


def _whole_number(digits: str) -> int:
    if len(digits) > _MOST_DIGITS:
        raise ValueError(f"a number in it has {len(digits)} digits")
    return int(digits)


def _finite_number(digits: str) -> float:
    if not math.isfinite(number := float(digits)):
        raise ValueError(f"a number in it is too large: {digits[:20]}")
    return number


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
