"""One sink for metrics: a line of JSON each, always, and TensorBoard beside it."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from pathlib import Path
from types import TracebackType

from torch import Tensor
from torch.utils.tensorboard import SummaryWriter

from bootifol.devices import to_floats
from bootifol.errors import BootifolError
from bootifol.types import Metrics, StepMetrics


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

    Args:
        directory: the run's directory.
        tensorboard: whether to write event files under `directory/tensorboard`.
    """

    def __init__(self, directory: Path, tensorboard: bool = True) -> None:
        directory.mkdir(parents=True, exist_ok=True)
        self.path = directory / "metrics.jsonl"
        self._file = self.path.open("a")
        self._writer = SummaryWriter(str(directory / "tensorboard")) if tensorboard else None

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
        self._file.write(json.dumps(line | numbers) + "\n")
        self._file.flush()
        if self._writer is not None:
            for name, value in metrics.items():
                self._writer.add_scalar(f"{phase}/{name}", value, count)

    def bytes_written(self) -> int:
        """Size of `metrics.jsonl`, which a checkpoint keeps so that a resumed run goes on from there."""
        return self._file.tell()

    def close(self) -> None:
        self._file.close()
        if self._writer is not None:
            self._writer.close()

    def __enter__(self) -> Tracker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()
