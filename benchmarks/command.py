"""How every benchmark ends: 0 or its own code; 2 after bad input and 130 after Ctrl-C, with a sentence on stderr."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from typing import ParamSpec

from bootifol.errors import STOPPED, BootifolError

BAD_INPUT = 2

PROGRAM = (sys.executable, "-m", "bootifol")
"""What the words of a command of the library's are given to, where a benchmark wants a process of its own."""

Words = ParamSpec("Words")


def command(resumes: bool = False) -> Callable[[Callable[Words, int | None]], Callable[Words, int]]:
    """Makes a benchmark's `main` return an exit code, and say on stderr why it is not 0.

    Args:
        resumes: whether the same command goes on with what an interrupted one has kept; the sentence after Ctrl-C
            says so.
    """

    def decorated(main: Callable[Words, int | None]) -> Callable[Words, int]:
        @functools.wraps(main)
        def exit_code(*args: Words.args, **kwargs: Words.kwargs) -> int:
            try:
                return main(*args, **kwargs) or 0
            except BootifolError as error:
                print(f"error: {error}", file=sys.stderr)
                return BAD_INPUT
            except KeyboardInterrupt:
                how = "; the same command goes on with what is done already" if resumes else ""
                print(f"stopped{how}", file=sys.stderr)
                return STOPPED

        return exit_code

    return decorated
