"""Standard output and error that may go away: a closed terminal, a pipe that nobody reads, a full disk.

What is shown is worth less than what is done: while `output_may_fail` is entered, whatever cannot be shown is dropped.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast


@contextmanager
def output_may_fail() -> Iterator[None]:
    """While entered, an error in writing to standard output or error drops the text and raises nothing."""
    before = sys.stdout, sys.stderr
    ours = tuple(cast(TextIO, _Dropping(stream)) for stream in before)
    sys.stdout, sys.stderr = ours
    try:
        yield
    finally:
        for stream in ours:
            stream.flush()  # what fails later, when Python exits, would change the exit code
        if sys.stdout is ours[0]:
            sys.stdout = before[0]
        if sys.stderr is ours[1]:
            sys.stderr = before[1]


class _Dropping:
    """A stream that never fails.

    Args:
        stream: where text goes as long as it can.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with self._errors():
            try:
                self._stream.write(text)
            except UnicodeEncodeError:
                encoding = self._stream.encoding or "ascii"
                self._stream.write(text.encode(encoding, "replace").decode(encoding))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        self.write("".join(lines))

    def flush(self) -> None:
        with self._errors():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (
            RuntimeError
        ):  # a signal came while this stream was being written to, and its handler writes, too
            pass
        except (OSError, ValueError):  # the latter where it is closed
            with suppress(OSError, ValueError):
                number, nowhere = self._stream.fileno(), os.open(os.devnull, os.O_WRONLY)
                if nowhere != number:  # it is, where the stream's own was closed
                    os.dup2(nowhere, number)
                    os.close(nowhere)
                self._stream.flush()  # what waits in its buffer goes there
