"""The process of a run: `bootifol`, which is asked to stop when whoever began it is gone.

    python -m bootifol.sweep.child train --resume RUN

Its standard input is a pipe that nobody writes to. Where its other end is closed, because the run shall stop, or
because the process that held it was killed, this one writes a checkpoint and ends.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Sequence

from bootifol.sweep.worker import PATIENCE


def main(words: Sequence[str]) -> int:
    """Runs one command of `bootifol`, or `random`, which is none.

    Args:
        words: of the command.

    Returns:
        Its exit code.
    """
    threading.Thread(target=_end_with_the_pipe, daemon=True).start()
    from bootifol.sweep.planned import RANDOM

    if words[0] == RANDOM:
        from bootifol.sweep.random_actions import main as play

        return play(words[1:])
    from bootifol.cli.main import main as run

    return run(words)


def _end_with_the_pipe() -> None:
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PATIENCE)
    os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
