"""What is done on the machine that Ray chooses for a run: its process is begun, and what became of it is written down.

A process of Ray's waits for every run, so this imports next to nothing: PyTorch would take hundreds of MB of each.
"""

from __future__ import annotations

import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from bootifol.errors import STOPPED, BootifolError
from bootifol.files import write_json
from bootifol.locks import one_writer
from bootifol.sweep.beside import Place, error_file, log_file, note_failure, place_file

PROGRAM = (sys.executable, "-m", "bootifol.sweep.child")

PATIENCE = 60.0
"""Seconds that a run has for its checkpoint."""

_POLL_SECONDS = 0.2
_THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Surroundings:
    """What a process of `bootifol` finds. All machines must have the sweep's files under the same names."""

    home: str
    """The directory in which the sweep was begun; paths are relative to it."""
    python_path: str
    """PYTHONPATH of the sweep."""
    cpus: int
    gpus: float

    @staticmethod
    def here(cpus: int, gpus: float) -> Surroundings:
        """As they are in this process."""
        return Surroundings(str(Path.cwd()), os.environ.get("PYTHONPATH", ""), cpus, gpus)


@dataclass(frozen=True)
class Ending:
    """How a run ended."""

    done: bool = False
    error: str = ""
    """The sentence it failed with. Without one, a run that is not done was asked to stop."""


def work_on(
    directory: Path, begin: Sequence[str], go_on: Sequence[str], recording: str, surroundings: Surroundings
) -> Ending:
    """Begins a run, or goes on with it, until it ends.

    Args:
        directory: where it is written.
        begin: the words after `bootifol` that begin it.
        go_on: those that go on with it.
        recording: what went wrong when its videos were recorded, or nothing.
        surroundings: of its process.

    Returns:
        How it ended. Whoever cancels the Ray task lets it write a checkpoint first.

    Raises:
        Killed: so that Ray repeats the task, which then goes on with the run.
    """
    _hear_cancellation()
    try:
        os.chdir(surroundings.home)
        if recording:
            return _failed(directory, f"its videos could not be recorded: {recording}")
        error_file(directory).unlink(missing_ok=True)
        resumed = (directory / "config.json").is_file()
        if resumed:
            # Its last process may be writing its last checkpoint, on this machine or on another.
            with suppress(BootifolError), one_writer(directory, wait=2 * PATIENCE):
                pass
        attempt = _Attempt(go_on if resumed else begin, log_file(directory), surroundings)
        write_json(place_file(directory), vars(Place.here(attempt.pid, resumed)))
        try:
            code = attempt.wait()
        finally:
            place_file(directory).unlink(missing_ok=True)
        if code is None or code == 0:
            return Ending(done=code == 0)
        if code < 0 or code == STOPPED:
            raise Killed(attempt.what_went_wrong())
        return _failed(directory, attempt.what_went_wrong())
    except OSError as error:
        return Ending(error=_unlike(surroundings, error))


def _hear_cancellation() -> None:
    """Ray cancels a task by an interrupt, which nobody hears in what a shell began in the background: there SIGINT is
    ignored."""
    if (
        signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        and threading.current_thread() is threading.main_thread()
    ):
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _failed(directory: Path, error: str) -> Ending:
    note_failure(directory, error)
    return Ending(error=error)


def record(words: Sequence[str], log: Path, surroundings: Surroundings) -> str:
    """Records demo sets.

    Args:
        words: after `bootifol`.
        log: what it prints goes there.
        surroundings: of its process.

    Returns:
        The sentence of what went wrong, or nothing.
    """
    _hear_cancellation()
    try:
        os.chdir(surroundings.home)
        attempt = _Attempt(words, log, surroundings)
        return "" if attempt.wait() == 0 else attempt.what_went_wrong()
    except OSError as error:
        return _unlike(surroundings, error)


def _unlike(surroundings: Surroundings, error: OSError) -> str:
    return (
        f"{socket.gethostname()} does not have the files of the sweep at {surroundings.home} ({error}): all machines "
        "must share a file system, and may write to it"
    )


class Killed(Exception):  # noqa: N818
    """A run's process was ended from outside, as where a machine is shut down or has no memory left."""


class _Attempt:
    """A process of `bootifol`, which ends with this one."""

    def __init__(self, words: Sequence[str], log: Path, surroundings: Surroundings) -> None:
        self._log = log
        log.parent.mkdir(parents=True, exist_ok=True)
        environment = {**os.environ, **dict.fromkeys(_THREADS, str(surroundings.cpus))}
        if surroundings.python_path:
            environment["PYTHONPATH"] = surroundings.python_path
        if not surroundings.gpus:
            environment["CUDA_VISIBLE_DEVICES"] = ""
        with log.open("ab") as file:
            file.write(f"$ bootifol {shlex.join(words)}  # on {socket.gethostname()}\n".encode())
            file.flush()
            self._log_begins = file.tell()
            self._process = subprocess.Popen(
                [*PROGRAM, *words],
                stdin=subprocess.PIPE,
                stdout=file,
                stderr=subprocess.STDOUT,
                env=environment,
                # Ctrl-C in a terminal reaches the sweep alone, which tells the runs once.
                start_new_session=True,
            )
        self.pid = self._process.pid

    def wait(self) -> int | None:
        """The exit code; None where it was asked to stop."""
        try:
            while self._process.poll() is None:
                time.sleep(_POLL_SECONDS)
        except KeyboardInterrupt:  # so Ray cancels a task
            assert self._process.stdin is not None
            self._process.stdin.close()
            self._outlast()
            return None
        return self._process.returncode

    def _outlast(self) -> None:
        """Waits until the process has ended, though Ray repeats its interrupt: a run that it calls stopped writes no
        more."""
        while True:
            with suppress(KeyboardInterrupt):
                self._process.wait()
                return

    def what_went_wrong(self) -> str:
        """One line."""
        return what_went_wrong(self._process.returncode, self._log, self._log_begins)


def what_went_wrong(exit_code: int, log: Path, begins: int) -> str:
    """One line about a process that failed.

    Args:
        exit_code: of the process; negative for a signal.
        log: what it printed.
        begins: where in the log its own lines begin.
    """
    if exit_code == STOPPED:
        return "asked to stop from outside of the sweep"
    if exit_code < 0:
        name = signal.Signals(-exit_code).name
        return f"killed by {name}" + (" (is there enough memory?)" if name == "SIGKILL" else "")
    lines = [line.strip() for line in log.read_bytes()[begins:].decode(errors="replace").splitlines()]
    lines = [line for line in lines if line]
    errors = [line.removeprefix("error:").strip() for line in lines if line.startswith("error:")]
    return (errors or lines or [f"exit code {exit_code}"])[-1]
