"""One writer a directory: a lock that ends with its process, however that ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from bootifol.errors import BootifolError

NAME = ".lock"
"""Of the lock's file, which is there while somebody writes."""


@contextmanager
def one_writer(directory: Path, lock: Path | None = None, wait: float = 0.0) -> Iterator[None]:
    """Keeps other processes from writing into a directory; makes it, and removes it where nothing came into it.

    Args:
        directory: what is written.
        lock: the lock's file, by default in the directory.
        wait: seconds to wait for another process to end.

    Raises:
        BootifolError: another process writes there, or this one may not.
    """
    file = lock or directory / NAME
    made: list[Path] = []
    try:
        made = [path for path in (file.parent, *file.parent.parents) if not path.exists()]
        file.parent.mkdir(parents=True, exist_ok=True)
        held = FileLock(file, timeout=wait)
        held.acquire()
    except Timeout:
        raise BootifolError(
            f"another process is writing to {directory}: wait until it has ended, or choose another directory"
        ) from None
    except (OSError, NotImplementedError) as error:
        _remove_empty(made)
        raise BootifolError(
            f"cannot write to {directory}: {error}; choose another directory, or see who may write there"
        ) from error
    try:
        yield
    finally:
        with suppress(OSError):
            file.unlink()  # while it is held: who waits for it sees that it is gone and makes a new one
        held.release()
        _remove_empty(made)


def _remove_empty(directories: list[Path]) -> None:
    for directory in directories:
        with suppress(OSError):
            directory.rmdir()
