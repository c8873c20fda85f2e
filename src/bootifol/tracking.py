"""What a run logs: a line of JSON each in `metrics.jsonl`, always, and a tracker beside it where one is chosen.

A tracker is anything with the three methods of `Tracker`; TensorBoard and Weights & Biases are here.
"""

from __future__ import annotations

import json
import math
import os
import re
import secrets
import shutil
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Protocol

from torch import Tensor

from bootifol.devices import to_floats
from bootifol.errors import BootifolError, warn
from bootifol.files import parsed_json, written_aside
from bootifol.types import Metrics, StepMetrics

TrackerName = Literal["none", "tensorboard", "wandb"]

COUNTS = {"alignment": "gradient_step", "cloning": "gradient_step", "interactive": "agent_steps"}
"""What each phase counts."""

_PIECE = 1 << 16


class Averages:
    """Means of metrics since the last `pop`, so that a log line stands for all the steps it covers."""

    def __init__(self) -> None:
        self._values: dict[str, list[float | Tensor]] = defaultdict(list)

    def add(self, metrics: StepMetrics) -> None:
        """Takes metrics in; what is on a device stays there, for fetching it would make the host wait."""
        for name, value in metrics.items():
            self._values[name].append(value)

    def pop(self) -> dict[str, float]:
        """The means, fetched where they are.

        Raises:
            BootifolError: a loss is NaN or infinite, which learners on a GPU leave to be found here; they skipped the
                steps.
        """
        means = {name: sum(to_floats(values)) / len(values) for name, values in self._values.items()}
        self._values.clear()
        for name, mean in means.items():
            if name.endswith("loss") and not math.isfinite(mean):
                raise BootifolError(
                    f"{name} was not a finite number at some of the last steps, which were not taken; the rewards may "
                    "have grown without bound: lower the learning rate in the run's config.json"
                )
        return means


class Tracker(Protocol):
    """Who is told what a run logs, beside `metrics.jsonl`."""

    def log(self, phase: str, count_name: str, count: int, seconds: float, metrics: Metrics) -> None:
        """Takes metrics of one moment, as `RunLog.log` does."""

    def report(self, page: Path, videos: Sequence[Path]) -> None:
        """Takes the report and the showcase's videos of a run that has ended."""

    def close(self) -> None:
        """Nothing comes after it."""


class RunLog:
    """Writes `metrics.jsonl` into a run's directory, and tells a tracker the same.

    A line is in the file when `log` returns.

    Args:
        directory: the run's directory.
        tracker: who else is told; None for nobody.

    Raises:
        BootifolError: the file, or one of the tracker's, cannot be written; so do all methods.
    """

    def __init__(self, directory: Path, tracker: Tracker | None = None) -> None:
        self.path = directory / "metrics.jsonl"
        self._tracker = tracker
        with _write_errors(directory):
            directory.mkdir(parents=True, exist_ok=True)
            if self.path.exists() and not self.path.is_file():
                raise OSError(f"{self.path} is no file")
            self._file = self.path.open("ab", buffering=0)

    def log(self, phase: str, count_name: str, count: int, seconds: float, metrics: Metrics) -> None:
        """Logs metrics of one moment.

        Args:
            phase: "alignment", "cloning" or "interactive".
            count_name: the unit that `count` counts: "gradient_step" or "agent_steps".
            count: how far the phase is.
            seconds: wall-clock time of the run so far, over all its sessions.
            metrics: names and values; a value that is not finite is written as null.
        """
        line = {"phase": phase, count_name: count, "seconds": round(seconds, 3)}
        numbers = {name: float(value) if math.isfinite(value) else None for name, value in metrics.items()}
        with _write_errors(self.path.parent):
            self._append((json.dumps(line | numbers) + "\n").encode())
            if self._tracker is not None:
                self._tracker.log(phase, count_name, count, seconds, metrics)

    def report(self, page: Path, videos: Sequence[Path]) -> None:
        """Shows the tracker the report and the showcase's videos."""
        if self._tracker is not None:
            with _write_errors(self.path.parent):
                self._tracker.report(page, videos)

    def bytes_written(self) -> int:
        """Size of `metrics.jsonl`, which a checkpoint keeps so that a resumed run goes on from there.

        So many bytes are on the disk, whatever happens to the machine, before any checkpoint says so.
        """
        with _write_errors(self.path.parent):
            os.fsync(self._file.fileno())
            return os.fstat(self._file.fileno()).st_size

    def close(self) -> None:
        with _write_errors(self.path.parent):
            self._file.close()
            tracker, self._tracker = self._tracker, None
            if tracker is not None:
                tracker.close()

    def _append(self, line: bytes) -> None:
        """Appends a whole line, or nothing."""
        before = os.fstat(self._file.fileno()).st_size
        rest = memoryview(line)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            with suppress(OSError):
                self._file.truncate(before)
            raise

    def __enter__(self) -> RunLog:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class TensorBoard:
    """Event files under `directory/tensorboard`. They show what `metrics.jsonl` holds: where there are some already, of
    a run that goes on, they are written anew from it, without what was undone.

    Args:
        directory: the run's directory.

    Raises:
        BootifolError: they cannot be written.
    """

    def __init__(self, directory: Path) -> None:
        from torch.utils.tensorboard import SummaryWriter

        events = directory / "tensorboard"
        with _write_errors(directory):
            earlier = sorted(events.glob("events.out.tfevents.*"))
            for file in earlier:
                file.unlink()
            self._writer = SummaryWriter(str(events))
            if earlier:
                self._repeat(directory / "metrics.jsonl")

    def log(self, phase: str, count_name: str, count: int, seconds: float, metrics: Metrics) -> None:
        for name, value in metrics.items():
            self._writer.add_scalar(f"{phase}/{name}", value, count)

    def report(self, page: Path, videos: Sequence[Path]) -> None:
        """Event files hold curves alone."""

    def close(self) -> None:
        self._writer.close()

    def _repeat(self, path: Path) -> None:
        """Writes what `metrics.jsonl` holds as events, at times that lie as far apart as then."""
        records = []
        for line in path.read_text(errors="replace").splitlines():
            with suppress(ValueError):
                record = parsed_json(line)
                if isinstance(record, dict) and isinstance(record.get("seconds"), int | float):
                    records.append(record)
        began = time.time() - max((record["seconds"] for record in records), default=0.0)
        for record in records:
            phase, seconds = record.pop("phase", ""), record.pop("seconds")
            counts = [record.pop(name) for name in ("gradient_step", "agent_steps") if name in record]
            for name, value in record.items():
                if counts and isinstance(value, int | float):
                    self._writer.add_scalar(f"{phase}/{name}", value, counts[0], walltime=began + seconds)


class WeightsAndBiases:
    """A run of Weights & Biases: curves over each phase's own count, and at the end the videos and the report.

    Its files lie under `directory/wandb`, among them its id, under which a run that goes on does so there, too. The
    environment variables of wandb hold: WANDB_MODE, WANDB_PROJECT (else "bootifol"), WANDB_ENTITY and others. The
    configuration and the list of installed packages are sent with them, and no code, no output and nothing about the
    machine. Where W&B fails on the way, learning goes on without it.

    Args:
        directory: the run's directory.
        described: the run's configuration, which is sent.

    Raises:
        BootifolError: wandb is not installed, nobody is logged in, or its files cannot be written.
    """

    def __init__(self, directory: Path, described: Mapping[str, Any]) -> None:
        require_tracker("wandb")
        import wandb

        self._wandb = wandb
        settings = wandb.Settings(
            console="off",
            disable_code=True,
            disable_git=True,
            disable_job_creation=True,
            x_disable_meta=True,
            x_disable_machine_info=True,
            x_disable_stats=True,
        )
        files = directory / "wandb"
        began = files.exists()
        identity = self._identity(files / "bootifol-id.txt")
        try:
            self._run: Any = wandb.init(
                project=os.environ.get("WANDB_PROJECT") or "bootifol",
                name=os.environ.get("WANDB_NAME") or directory.resolve().name,
                id=identity,
                dir=str(directory.resolve()),
                config=dict(described),
                resume="allow",
                reinit="create_new",
                settings=settings,
            )
        except (wandb.Error, OSError, ValueError) as error:
            if not began:
                shutil.rmtree(files, ignore_errors=True)
            raise BootifolError(
                f"Weights & Biases cannot begin ({' '.join(str(error).split())}): log in with `wandb login`, set "
                "WANDB_MODE=offline to keep its files here, or choose --tracker none"
            ) from error
        for phase, count_name in COUNTS.items():
            self._run.define_metric(f"{phase}/{count_name}", hidden=True)
            self._run.define_metric(f"{phase}/*", step_metric=f"{phase}/{count_name}")

    def log(self, phase: str, count_name: str, count: int, seconds: float, metrics: Metrics) -> None:
        finite = {f"{phase}/{name}": float(value) for name, value in metrics.items() if math.isfinite(value)}
        self._tell(
            lambda run: run.log({**finite, f"{phase}/{count_name}": count, f"{phase}/seconds": seconds})
        )

    def report(self, page: Path, videos: Sequence[Path]) -> None:
        shown: dict[str, Any] = {}
        for video in videos:
            shown[f"showcase/{video.stem}"] = self._wandb.Video(str(video), format="mp4")
        shown["report"] = self._wandb.Html(str(page), inject=False)
        self._tell(lambda run: run.log(shown))

    def close(self) -> None:
        self._tell(lambda run: run.finish())
        self._run = None

    def _tell(self, what: Callable[[Any], object]) -> None:
        if self._run is None:
            return
        try:
            what(self._run)
        except Exception as error:  # of somebody else's service, which learning does not need
            self._run = None
            told = " ".join(str(error).split())
            warn(f"Weights & Biases hears no more of this run ({told}); metrics.jsonl goes on")

    @staticmethod
    def _identity(path: Path) -> str:
        """The id under which W&B knows the run, the same when it goes on."""
        if path.is_file() and re.fullmatch("[a-z0-9]{8}", text := path.read_text(errors="replace").strip()):
            return text
        identity = secrets.token_hex(4)
        with written_aside(path) as aside:
            aside.write_text(identity + "\n")
        return identity


def require_tracker(name: TrackerName) -> None:
    """Refuses a tracker that was chosen and is not installed. TensorBoard, the default, is left out then.

    Raises:
        BootifolError: see there.
    """
    if name == "wandb" and ((spec := find_spec("wandb")) is None or spec.origin is None):
        raise BootifolError(
            "the tracker wandb is not installed: `pip install 'bootifol[wandb]'`, or choose --tracker tensorboard or "
            "none"
        )


def make_tracker(name: TrackerName, directory: Path, described: Mapping[str, Any]) -> Tracker | None:
    """The tracker that a configuration names; None for none, and for TensorBoard where it is not installed.

    Args:
        name: of the tracker.
        directory: the run's directory.
        described: the run's configuration, for trackers that show it.

    Raises:
        BootifolError: it is not installed or cannot begin.
    """
    require_tracker(name)
    if name == "wandb":
        return WeightsAndBiases(directory, described)
    if name == "tensorboard" and find_spec("tensorboard") is not None:
        return TensorBoard(directory)
    return None


@contextmanager
def _write_errors(directory: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise BootifolError(
            f"the metrics cannot be written to {directory}: {error}; free some space, or see who may write there"
        ) from error


def cut_metrics(path: Path, size: int) -> int:
    """Cuts `metrics.jsonl` back to the whole lines among its first bytes; a shorter file is not made longer.

    Args:
        path: the file; there may be none.
        size: how many bytes are kept at most.

    Returns:
        How many bytes are missing, because the file is shorter or a line among them is not whole.

    Raises:
        BootifolError: the file cannot be changed.
    """
    if not path.exists():
        return size
    try:
        if not path.is_file():
            raise OSError("it is no file")
        with path.open("r+b") as file:
            file.truncate(min(size, os.fstat(file.fileno()).st_size))
            kept = file.seek(0, os.SEEK_END)
            while kept:
                first = max(kept - _PIECE, 0)
                file.seek(first)
                if (newline := file.read(kept - first).rfind(b"\n")) >= 0:
                    kept = first + newline + 1
                    break
                kept = first
            file.truncate(kept)
    except OSError as error:
        raise BootifolError(
            f"{path} cannot be cut back to the checkpoint: {error}; see who may write there, or copy the run"
        ) from error
    return size - kept
