"""One sink for metrics: a line of JSON each, always, and TensorBoard beside it."""

from __future__ import annotations

import json
import math
import os
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from torch import Tensor

from bootifol.devices import to_floats
from bootifol.errors import BootifolError
from bootifol.files import parsed_json
from bootifol.types import Metrics, StepMetrics

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

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


class Tracker:
    """Writes `metrics.jsonl` and TensorBoard event files into a run's directory.

    A line is in the file when `log` returns. TensorBoard shows what `metrics.jsonl` holds: where event files are there
    already, of a run that goes on, they are written anew from it, without what was undone.

    Args:
        directory: the run's directory.
        tensorboard: whether to write event files under `directory/tensorboard`, where TensorBoard is installed.

    Raises:
        BootifolError: the files cannot be written; so do all methods.
    """

    def __init__(self, directory: Path, tensorboard: bool = True) -> None:
        self.path = directory / "metrics.jsonl"
        self._events = directory / "tensorboard"
        self._writer: SummaryWriter | None = None
        with self._errors():
            directory.mkdir(parents=True, exist_ok=True)
            if self.path.exists() and not self.path.is_file():
                raise OSError(f"{self.path} is no file")
            self._file = self.path.open("ab", buffering=0)
            if tensorboard and find_spec("tensorboard") is not None:
                self._begin_events()

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
        with self._errors():
            self._append((json.dumps(line | numbers) + "\n").encode())
            if self._writer is not None:
                for name, value in metrics.items():
                    self._writer.add_scalar(f"{phase}/{name}", value, count)

    def bytes_written(self) -> int:
        """Size of `metrics.jsonl`, which a checkpoint keeps so that a resumed run goes on from there.

        So many bytes are on the disk, whatever happens to the machine, before any checkpoint says so.
        """
        with self._errors():
            os.fsync(self._file.fileno())
            return os.fstat(self._file.fileno()).st_size

    def close(self) -> None:
        with self._errors():
            self._file.close()
            if self._writer is not None:
                self._writer.close()

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

    def _begin_events(self) -> None:
        from torch.utils.tensorboard import SummaryWriter

        earlier = sorted(self._events.glob("events.out.tfevents.*"))
        for file in earlier:
            file.unlink()
        self._writer = SummaryWriter(str(self._events))
        if earlier:
            self._repeat_metrics(self._writer)

    def _repeat_metrics(self, writer: SummaryWriter) -> None:
        """Writes what `metrics.jsonl` holds as events, at times that lie as far apart as then."""
        records = []
        for line in self.path.read_text(errors="replace").splitlines():
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
                    writer.add_scalar(f"{phase}/{name}", value, counts[0], walltime=began + seconds)

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise BootifolError(
                f"the metrics cannot be written to {self.path.parent}: {error}; free some space, or see who may write "
                "there"
            ) from error

    def __enter__(self) -> Tracker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


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
