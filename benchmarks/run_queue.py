"""Runs the runs of a suite, each in a process and on a core of its own, and goes on where it stopped.

    OUT/TASK/METHOD[-VARIANT]/seedN           the run, as `bootifol train` writes it
    OUT/TASK/METHOD[-VARIANT]/seedN.log       what it printed, in all attempts
    OUT/TASK/METHOD[-VARIANT]/seedN.failed    the sentence it failed with, if it did

    OUT/modules                               the module of the tutorial's method, where a run is of that

    KEEP/TASK/METHOD[-VARIANT]/seedN          what tables read of a run that is done, where there is to be such a copy

There is no other record: what is done and what is left is read from these files.
"""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

from benchmarks.page_modules import ADD_A_METHOD, write_page_modules
from benchmarks.run_state import RunState, check_is_planned, error_file, keep, log_file, run_state
from benchmarks.suites import OPTIMAL_TRANSPORT, RANDOM, VIDEOS, PlannedRun, demos_of
from bootifol.demos.manifest import MANIFEST_NAME, read_manifest
from bootifol.errors import STOPPED, BootifolError
from bootifol.files import written_aside
from bootifol.own_modules import imports_code
from bootifol.progress import duration
from bootifol.training.budget import parse_duration
from bootifol.training.config import TrainingConfig
from bootifol.training.interruption import Interruption

PROGRAM = (sys.executable, "-m", "bootifol")
"""What `train` and `demos record` are words to."""

_POLL_SECONDS = 0.2
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMBA")}


@dataclass(frozen=True)
class Active:
    """A run in progress."""

    run: PlannedRun
    process: subprocess.Popen[bytes]
    core: int | None
    log_begins: int
    """Where in the log this attempt begins."""


@dataclass(frozen=True)
class Outcome:
    """How many runs of the suite are in which state when the queue ends."""

    done: int
    failed: int
    left: int

    def __str__(self) -> str:
        return f"{self.done} done, {self.failed} failed, {self.left} left"


class RunQueue:
    """The queue.

    Args:
        runs: in the order to begin them.
        out: directory of the suite.
        demos: directory of the demo sets, one a task and size of its videos; missing ones are recorded.
        workers: runs side by side, each on a core of its own.
        time_budget: of each run, such as "60m"; None for the agent steps of its configuration.
        videos: expert videos to record where there are none; by default what the preset wants.
        program: the command that `train` and `demos record` are words to.
        say: prints a line.
        kept: directory for copies of the results of runs that are done. A run with a copy there is done, wherever it
            was trained.

    Raises:
        BootifolError: there are fewer cores than workers, or a run was begun otherwise than it is planned.
    """

    def __init__(
        self,
        runs: Sequence[PlannedRun],
        out: Path,
        demos: Path,
        workers: int = 1,
        time_budget: str | None = None,
        videos: int | None = None,
        program: Sequence[str] = PROGRAM,
        say: Callable[[str], None] = print,
        kept: Path | None = None,
    ) -> None:
        self.runs = runs
        self.out = out
        self.demos = demos
        self.time_budget = time_budget
        self.videos = videos
        self.program = program
        self.say = say
        self.kept = kept
        self._cores = cores(workers)
        self._active: list[Active] = []
        self._stopping = False
        self._seconds = None if time_budget is None else parse_duration(time_budget)
        for run in runs:
            for directory in (self.directory(run), self.copy(run)):
                if directory is not None:
                    check_is_planned(run, directory, self._seconds)

    def directory(self, run: PlannedRun) -> Path:
        """Where a run is written."""
        return self.out / run.name

    def copy(self, run: PlannedRun) -> Path | None:
        """Where its results are kept, too."""
        return None if self.kept is None else self.kept / run.name

    @property
    def _modules(self) -> Path:
        return self.out / "modules"

    def state(self, run: PlannedRun) -> RunState:
        """How far a run is."""
        return run_state(self.directory(run), self.copy(run))

    def outcome(self) -> Outcome:
        """The states of all runs."""
        states = [self.state(run).state for run in self.runs]
        done, failed = states.count("done"), states.count("failed")
        return Outcome(done, failed, len(states) - done - failed)

    def work(self) -> Outcome:
        """Runs what is not done, until all is done or failed, or Ctrl-C: then runs write checkpoints and end.

        Runs that failed before are tried again.

        Raises:
            BootifolError: another queue works in the same directory.
            KeyboardInterrupt: a second Ctrl-C; the runs are killed and go on from their last checkpoints.
        """
        with self._alone() as lock, Interruption() as interruption:
            try:
                for run in self.runs:
                    self._keep(run)
                waiting = [run for run in self.runs if self.state(run).state != "done"]
                waiting = self._with_demos(waiting, interruption, lock)
                if any(run.system.method == OPTIMAL_TRANSPORT for run in waiting):
                    write_page_modules(ADD_A_METHOD, self._modules)
                free = list(self._cores)
                while waiting or self._active:
                    if interruption.requested:
                        self._stop(waiting)
                    while waiting and free:
                        self._begin(waiting.pop(0), free.pop(0), lock, waiting)
                    for ended in [active for active in self._active if active.process.poll() is not None]:
                        self._active.remove(ended)
                        free.append(ended.core)
                        self._conclude(ended)
                    time.sleep(_POLL_SECONDS)
            finally:
                for active in self._active:
                    _kill(active.process)
        return self.outcome()

    def _with_demos(self, runs: list[PlannedRun], interruption: Interruption, lock: int) -> list[PlannedRun]:
        """The runs that have their videos; missing ones are recorded first, and where that fails, the runs fail."""
        ready = list(runs)
        for name, run in demos_of(runs).items():
            directory = self.demos / name
            missing = missing_demos(directory)
            if not missing:
                continue
            self.say(f"recording  {', '.join(missing)} videos of {run.task} in {directory}")
            error = self._record(run, directory, missing, interruption, lock)
            if interruption.requested:
                self.say("stopped    the same command goes on with the recording")
                return []
            if error:
                for failed in [other for other in ready if other.demos_name == name]:
                    self._fail(failed, f"its videos could not be recorded: {error}", log_file(directory))
                    ready.remove(failed)
        return ready

    def _record(
        self,
        run: PlannedRun,
        directory: Path,
        behaviors: Sequence[str],
        interruption: Interruption,
        lock: int,
    ) -> str:
        """Records demo sets; the sentence of what went wrong, or nothing."""
        videos, workers = self.videos or VIDEOS[run.preset], len(self._cores)
        words = record_words(run.task, run.config, directory, videos, behaviors, workers)
        process, log_begins = self._start([*self.program, *words], log_file(directory), lock)
        stopping = False
        try:
            while process.poll() is None:
                if interruption.requested and not stopping:
                    stopping = True
                    process.terminate()
                time.sleep(_POLL_SECONDS)
        finally:
            _kill(process)
        return what_went_wrong(process.returncode, log_file(directory), log_begins)

    def _begin(self, run: PlannedRun, core: int | None, lock: int, waiting: Sequence[PlannedRun]) -> None:
        directory = self.directory(run)
        resumes = (directory / "config.json").is_file()
        error_file(directory).unlink(missing_ok=True)
        words = run.words(self.demos / run.demos_name, directory, self.time_budget)
        command = [*self.program, "train", *words]
        if run.system.method == RANDOM:
            command = [sys.executable, "-m", "benchmarks.random_policy", *words]
        elif resumes:
            command = [*self.program, "train", "--resume", str(directory)]
            if imports_code(run.task) or imports_code(run.system.method):
                command.append("--trust")
        process, log_begins = self._start(command, log_file(directory), lock)
        if core is not None:
            with suppress(ProcessLookupError):  # it may have ended already
                os.sched_setaffinity(process.pid, {core})
        self._active.append(Active(run, process, core, log_begins))
        left = self._time_left(waiting)
        self.say(
            f"{'resumed' if resumes else 'begun':10} {run.name}; {len(self._active)} running, "
            f"{len(waiting)} waiting{'' if left is None else f', about {duration(left)} left'}"
        )

    def _start(self, command: Sequence[str], log: Path, lock: int) -> tuple[subprocess.Popen[bytes], int]:
        """A process that appends to a log; returns it and where in the log it begins."""
        log.parent.mkdir(parents=True, exist_ok=True)
        found_in = [str(self._modules.resolve()), os.environ.get("PYTHONPATH", "")]
        with log.open("ab") as file:
            file.write(f"$ {' '.join(command)}\n".encode())
            file.flush()
            begins = file.tell()
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                env={**os.environ, **_ONE_THREAD, "PYTHONPATH": os.pathsep.join(filter(None, found_in))},
                # Ctrl-C in a terminal reaches the queue alone, which tells the runs once.
                start_new_session=True,
                # A run outlives a queue that is killed; the lock that it holds keeps other queues away from it.
                pass_fds=[lock],
            )
        return process, begins

    def _stop(self, waiting: list[PlannedRun]) -> None:
        """Begins no more runs, and asks those in progress, once, to write a checkpoint and end."""
        waiting.clear()
        if not self._stopping:
            self._stopping = True
            for active in self._active:
                active.process.terminate()

    def _conclude(self, ended: Active) -> None:
        directory = self.directory(ended.run)
        state = run_state(directory)
        self._keep(ended.run)
        code = ended.process.returncode
        if state.state == "done":
            self.say(
                f"{'done':10} {ended.run.name}: {state.agent_steps:,} agent steps in {duration(state.seconds)}"
            )
        elif self._stopping or code in (0, STOPPED):
            self.say(f"{'stopped':10} {ended.run.name}: the same command goes on with it")
        else:
            log = log_file(directory)
            self._fail(ended.run, what_went_wrong(code, log, ended.log_begins), log)

    def _keep(self, run: PlannedRun) -> None:
        """Copies the results of a run that is done in its own directory, if there are to be copies."""
        copy = self.copy(run)
        if copy is not None and run_state(self.directory(run)).state == "done":
            keep(self.directory(run), copy)

    def _fail(self, run: PlannedRun, error: str, log: Path) -> None:
        directory = self.directory(run)
        with written_aside(error_file(directory)) as aside:
            aside.write_text(f"{error}\n")
        self.say(f"{'failed':10} {run.name}: {error} (see {log})")

    def _time_left(self, waiting: Sequence[PlannedRun]) -> float | None:
        """Seconds until all runs have learned, if each takes as long as those that are done; None before the first."""
        states = {run: self.state(run) for run in self.runs}
        done = {
            run: state.seconds for run, state in states.items() if state.state == "done" and state.seconds
        }
        if self._seconds is None and not done:
            return None
        left = 0.0
        for run in [*waiting, *(active.run for active in self._active)]:
            alike = [seconds for other, seconds in done.items() if other.system == run.system] or list(
                done.values()
            )
            expected = self._seconds if self._seconds is not None else mean(alike)
            if run.system.method != RANDOM:
                left += max(expected - states[run].seconds, 0.0)
        return left / len(self._cores)

    @contextmanager
    def _alone(self) -> Iterator[int]:
        """Holds the directory's lock; yields its file descriptor."""
        self.out.mkdir(parents=True, exist_ok=True)
        with (self.out / ".queue.lock").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise BootifolError(
                    f"another queue works in {self.out}, or runs that it began do: wait for it, or choose another --out"
                ) from None
            yield file.fileno()


def cores(workers: int) -> list[int | None]:
    """A core for each worker, of those that this process may use; None each where the system pins no process.

    Raises:
        BootifolError: there are fewer.
    """
    if workers < 1:
        raise BootifolError(f"--workers must be at least 1, not {workers}")
    if not hasattr(os, "sched_getaffinity"):
        return [None] * workers
    usable = sorted(os.sched_getaffinity(0))
    if workers > len(usable):
        raise BootifolError(
            f"{workers} workers need as many cores and there are {len(usable)}: runs that share a core are not "
            f"compared on equal terms, so use --workers {len(usable)} at most"
        )
    return list(usable[:workers])


def record_words(
    task: str,
    config: TrainingConfig,
    directory: Path,
    videos: int,
    behaviors: Sequence[str],
    workers: int = 1,
) -> list[str]:
    """The words after `bootifol` that record what runs of a configuration learn from.

    Args:
        task: what to perform.
        config: of the runs, which decides how the videos must look and how long they are.
        directory: of the demo sets.
        videos: of each behavior.
        behaviors: who performs.
        workers: processes that record.
    """
    pictures = config.pictures
    words = ["demos", "record", "--task", task, "--out", str(directory)]
    words += ["--episodes", str(videos), "--workers", str(workers)]
    for name, length in (("episode-steps", config.episode_steps), ("action-repeat", config.action_repeat)):
        words += [] if length is None else [f"--{name}", str(length)]
    words += ["--agent-size", str(pictures.agent_size), "--video-size", str(pictures.video_size)]
    return [*words, "--profile", pictures.profile, "--behaviors", *behaviors]


def missing_demos(directory: Path) -> list[str]:
    """The behaviors that a run needs videos of, and whose recording is not complete in the directory."""

    def complete(behavior: str) -> bool:
        path = directory / behavior
        return (path / MANIFEST_NAME).is_file() and read_manifest(path).complete

    # half_good videos only measure the reward: recorded with the expert's, and not missed beside imported ones.
    if not complete("expert"):
        return ["expert", "random", "half_good"]
    return [] if complete("random") else ["random"]


def what_went_wrong(exit_code: int, log: Path, begins: int) -> str:
    """One line about a process that failed; nothing about one that did not.

    Args:
        exit_code: of the process; negative for a signal.
        log: what it printed.
        begins: where in the log its own lines begin.
    """
    if exit_code == 0:
        return ""
    if exit_code < 0:
        name = signal.Signals(-exit_code).name
        return f"killed by {name}" + (" (is there enough memory?)" if name == "SIGKILL" else "")
    lines = [line.strip() for line in log.read_bytes()[begins:].decode(errors="replace").splitlines()]
    lines = [line for line in lines if line]
    errors = [line.removeprefix("error:").strip() for line in lines if line.startswith("error:")]
    return (errors or lines or [f"exit code {exit_code}"])[-1]


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Ends a process and those it started, if it still runs."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
