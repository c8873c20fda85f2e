"""Runs the runs of a sweep on Ray, and goes on where it stopped.

A run is a Ray task, which is given cores and GPUs, and goes on on another machine when its own dies; the task begins
`bootifol train` as a process (`worker.py`). Which run is done is read from the files that runs write.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from bootifol.devices import usable_cores
from bootifol.errors import BootifolError
from bootifol.locks import one_writer
from bootifol.plugins import told
from bootifol.sweep import worker
from bootifol.sweep.beside import Place, log_file, note_failure, place_file
from bootifol.sweep.planned import RANDOM, PlannedRun, missing_videos, record_words
from bootifol.sweep.progress import Board, Job
from bootifol.sweep.run_state import RunState, check_is_planned, progress_of, run_state
from bootifol.training.interruption import Interruption

LOCK = ".sweep.lock"
"""In the sweep's directory, while it is worked on."""

RAY_LOG = ".ray.log"
"""In the sweep's directory: what Ray says, as of a machine that has died."""

_POLL_SECONDS = 1.0
_OBJECT_STORE = 10**8
"""Bytes of memory that a local Ray keeps for results, of which runs have none to speak of."""
_OF_LOCAL_RAY = {
    "RAY_USAGE_STATS_ENABLED": "0",  # it would tell its authors that it is used
    "RAY_memory_monitor_refresh_ms": "0",  # it would kill and repeat what the system's own lack of memory ends
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # `worker.py` hides GPUs from runs that have none
}


@dataclass(frozen=True)
class Outcome:
    """How many runs are in which state when a sweep ends."""

    done: int
    failed: int
    left: int
    stopped: bool = False
    """Whether it was asked to."""

    def __str__(self) -> str:
        return f"{self.done} done, {self.failed} failed, {self.left} left"


def sweep(
    runs: Sequence[PlannedRun], out: Path, address: str | None = None, cpus: int | None = None
) -> Outcome:
    """Runs what is not done, until all is done or failed, or Ctrl-C: then runs write checkpoints and end.

    Runs that failed before are tried again.

    Args:
        runs: in the order to begin them.
        out: directory of the sweep.
        address: of a Ray cluster, such as "auto"; None for one on this machine, as long as the sweep takes.
        cpus: cores of that; by default those that this process may use.

    Raises:
        BootifolError: Ray is missing or cannot be reached, no machine has what a run needs, videos are missing, a run
            was begun otherwise than it is planned, or another sweep works in the same directory.
        KeyboardInterrupt: a second Ctrl-C; Ray ends the runs, which go on from the checkpoints that they had.
    """
    ray = _ray()
    jobs = [Job(run, out / run.name, run_state(out / run.name)) for run in runs]
    for job in jobs:
        check_is_planned(job.run, job.directory)
    waiting = [job for job in jobs if job.state.state != "done"]
    recordings = _recordings([job.run for job in waiting])
    stopped = False
    if waiting:
        with one_writer(out, out / LOCK), _said_to(out / RAY_LOG), _connected(ray, address, cpus):
            _require_machines(ray, [job.run for job in waiting])
            try:
                stopped = _work(ray, jobs, waiting, recordings)
            except ray.exceptions.RayError as error:
                raise BootifolError(
                    f"Ray has ended: {told(error)}; the same command goes on, once it is there again"
                ) from error
    states = [job.state.state for job in jobs]
    done, failed = states.count("done"), states.count("failed")
    return Outcome(done, failed, len(jobs) - done - failed, stopped)


def _ray() -> Any:
    try:
        import ray
    except ModuleNotFoundError as error:
        raise BootifolError(
            "a sweep runs on Ray, which is not installed; type `pip install 'bootifol[sweep]'`"
        ) from error
    return ray


def _recordings(runs: Sequence[PlannedRun]) -> dict[Path, tuple[PlannedRun, list[str]]]:
    """The directories whose videos are to be recorded, each with a run that wants them and the words that do it.

    Raises:
        BootifolError: videos are missing, and the sweep does not say how many to record.
    """
    found: dict[Path, tuple[PlannedRun, list[str]]] = {}
    to_say: dict[Path, str] = {}
    for run in runs:
        if run.demos in found or run.demos in to_say or run.method == RANDOM:
            continue
        if missing := missing_videos(run.demos):
            words = record_words(run, missing, run.videos or 1000)
            if run.videos is None:
                to_say[run.demos] = f"bootifol {shlex.join(words)}"
            else:
                found[run.demos] = run, words
    if to_say:
        raise BootifolError(
            f"videos are missing in {', '.join(map(str, to_say))}: record them (or import your own), or write `videos: "
            "1000` into the sweep's file, which then records that many\n  " + "\n  ".join(to_say.values())
        )
    return found


@contextmanager
def _said_to(log: Path) -> Iterator[None]:
    """While entered, standard output goes to a file: Ray prints there, and would do so through the table."""
    try:
        with log.open("a") as file, redirect_stdout(file):
            yield
    finally:
        if not log.stat().st_size:
            log.unlink()


@contextmanager
def _connected(ray: Any, address: str | None, cpus: int | None) -> Iterator[None]:
    quiet = {"log_to_driver": False, "logging_level": "CRITICAL"}
    try:
        if address is None:
            for name, value in _OF_LOCAL_RAY.items():
                os.environ.setdefault(name, value)
            ray.init(
                address="local",
                num_cpus=cpus or usable_cores(),
                include_dashboard=False,
                object_store_memory=_OBJECT_STORE,
                **quiet,
            )
        else:
            ray.init(address=address, **quiet)
    except (ConnectionError, RuntimeError, ValueError, OSError) as error:
        where = "on this machine" if address is None else f"at {address}"
        raise BootifolError(f"Ray cannot be reached {where}: {told(error)}; see `ray status`") from error
    try:
        yield
    finally:
        ray.shutdown()


def _require_machines(ray: Any, runs: Sequence[PlannedRun]) -> None:
    """Ray would wait for a machine that can take a run, however long.

    Raises:
        BootifolError: there is none.
    """
    machines = [node["Resources"] for node in ray.nodes() if node["Alive"]]
    for cpus, gpus in {(run.cpus, run.gpus) for run in runs}:
        if not any(of.get("CPU", 0) >= cpus and of.get("GPU", 0) >= gpus for of in machines):
            there = ", ".join(f"{of.get('CPU', 0):g} and {of.get('GPU', 0):g}" for of in machines)
            raise BootifolError(
                f"a run needs {cpus} cores and {gpus:g} GPUs, and no machine has them (there are {there}): lower cpus "
                "or gpus in the sweep's file, or begin it elsewhere"
            )


def _work(
    ray: Any,
    jobs: Sequence[Job],
    waiting: Sequence[Job],
    recordings: dict[Path, tuple[PlannedRun, list[str]]],
) -> bool:
    """Gives Ray what is not done, and waits for it.

    Returns:
        Whether it was asked to stop.
    """
    board = Board(jobs, Console(stderr=True))
    with Interruption() as interruption, board.shown():
        videos: dict[Path, Any] = {}
        for demos, (run, words) in recordings.items():
            board.print(f"recording  videos in {demos}")
            videos[demos] = _task(ray, run, worker.record).remote(
                words, log_file(demos), worker.Surroundings.here(run.cpus, gpus=0.0)
            )
        pending: dict[Any, Job] = {}
        for job in waiting:
            place_file(job.directory).unlink(missing_ok=True)
            job.pending, job.state = True, RunState("begun", *progress_of(job.directory))
            task = _task(ray, job.run, worker.work_on).remote(
                job.directory,
                job.run.words(job.directory),
                job.run.words_to_resume(job.directory),
                videos.get(job.run.demos, ""),
                worker.Surroundings.here(job.run.cpus, job.run.gpus),
            )
            pending[task] = job
        asked = False
        try:
            while pending:
                if interruption.requested and not asked:
                    asked = True
                    board.print("stopping: the runs write checkpoints; Ctrl-C again ends at once")
                    for task in [*pending, *videos.values()]:
                        ray.cancel(task)
                ready, _ = ray.wait(list(pending), timeout=_POLL_SECONDS)
                for task in ready:
                    _conclude(ray, task, pending.pop(task), board)
                for job in pending.values():
                    _look_at(job, board)
                board.update()
        finally:
            for task in pending:
                with suppress(Exception):
                    ray.cancel(task, force=True)
    return interruption.requested


def _task(ray: Any, run: PlannedRun, function: Callable[..., object]) -> Any:
    """A function of `worker.py` as a Ray task; what happens to a machine is repeated, a run's own failure is not."""
    return ray.remote(function).options(
        num_cpus=run.cpus,
        num_gpus=run.gpus,
        max_retries=run.retries,
        retry_exceptions=[worker.Killed],
        name=f"{function.__name__} {run.name}",
    )


def _look_at(job: Job, board: Board) -> None:
    """Reads how far a run is that Ray has."""
    place = Place.of(job.directory)
    if place is None:
        return
    job.state = RunState("begun", *progress_of(job.directory))
    if place != job.place:
        what = "resumed" if place.resumed else "begun"
        moved = " (it was killed where it was, or the machine died)" if job.place is not None else ""
        job.place = place
        board.say(job, what, f"on {place.host}{moved}")


def _conclude(ray: Any, task: Any, job: Job, board: Board) -> None:
    """Takes a run back that Ray has ended."""
    job.pending, job.place = False, None
    error, done = "", False
    try:
        ending: worker.Ending = ray.get(task)
        error, done = ending.error, ending.done
    except ray.exceptions.TaskCancelledError:
        pass
    except ray.exceptions.RayTaskError as failure:
        error = told(failure.cause)
    except ray.exceptions.RayError as failure:
        error = (
            f"its machine or its process there died {job.run.retries + 1} times ({type(failure).__name__})"
        )
    # What other machines have written may not be seen here yet; `ending` says how it is.
    job.state = RunState(
        "done" if done else "failed" if error else "begun", *progress_of(job.directory), error
    )
    if done:
        board.say(job, "done", job.state.far)
    elif error:
        note_failure(job.directory, error)
        board.say(job, "failed", f"{error} (see {log_file(job.directory)})", important=True)
    else:
        board.say(job, "stopped", "the same command goes on with it")
