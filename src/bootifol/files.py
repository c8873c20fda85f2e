"""Files that are either whole or absent: written aside, synced, renamed."""

from __future__ import annotations

import json
import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import load_file, save_file

from bootifol.errors import BootifolError
from bootifol.types import Arrays


@contextmanager
def written_aside(target: Path) -> Iterator[Path]:
    """Yields a path to write to; on success syncs it and renames it to `target`.

    On any error the half-written file or directory is removed, with directories made for it, and an existing `target`
    is untouched.

    Raises:
        BootifolError: the disk is full or not writable.
    """
    aside = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}.tmp")
    missing = [directory for directory in target.parents if not directory.exists()]
    try:
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
        if aside.is_dir():
            shutil.rmtree(aside, ignore_errors=True)
        else:
            aside.unlink(missing_ok=True)
        if not target.exists():
            for directory in missing:
                with suppress(OSError):  # others write there by now
                    directory.rmdir()


def write_json(target: Path, value: Any) -> None:
    """Writes `value` as indented JSON; NaN is refused (it is not JSON)."""
    text = json.dumps(value, indent=2, allow_nan=False) + "\n"
    with written_aside(target) as aside:
        aside.write_text(text)


def read_json(path: Path, what: str) -> Any:
    """Reads JSON.

    Args:
        path: the file.
        what: what the file is to the user, for the error's sentence ("the demo set's manifest").

    Raises:
        BootifolError: the file is missing or is not JSON.
    """
    try:
        return json.loads(path.read_text())
    except FileNotFoundError:
        raise BootifolError(f"{what} is missing: there is no {path}") from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise BootifolError(f"{what} cannot be read: {path}: {error}") from error


def write_arrays(target: Path, arrays: Arrays, texts: Mapping[str, str] | None = None) -> None:
    """Writes named arrays as one safetensors file, with named texts in its header."""
    with written_aside(target) as aside:
        # Not np.ascontiguousarray, which gives numbers without a dimension one.
        contiguous = {name: np.asarray(array, order="C") for name, array in arrays.items()}
        aside.touch()
        mode = aside.stat().st_mode
        save_file(contiguous, aside, None if texts is None else dict(texts))
        aside.chmod(mode)  # safetensors lets nobody but its writer read it


def read_arrays(path: Path, what: str) -> Arrays:
    """Reads a safetensors file; nothing is unpickled.

    Raises:
        BootifolError: the file is missing, truncated or damaged.
    """
    with _read_errors(path, what):
        return dict(load_file(path))


def read_texts(path: Path, what: str) -> dict[str, str]:
    """Reads the texts in the header of a safetensors file; empty where there are none.

    Raises:
        BootifolError: as `read_arrays`.
    """
    with _read_errors(path, what), safe_open(path, framework="numpy") as file:
        return dict(file.metadata() or {})


@contextmanager
def _read_errors(path: Path, what: str) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise BootifolError(f"{what} is missing: there is no {path}") from None
    except PermissionError:
        raise BootifolError(
            f"{what} must not be read by this user: {path}; ask its owner, or copy it"
        ) from None
    except (OSError, SafetensorError, ValueError) as error:
        raise BootifolError(f"{what} is damaged or incomplete: {path}: {error}") from error


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
