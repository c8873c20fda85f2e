"""Code of a user's that is called while a run learns: `bootifol.train(..., callbacks=[...])`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bootifol.errors import BootifolError


class StopTraining(Exception):  # noqa: N818
    """Raised by a callback, it stops the run as Ctrl-C does: after this step, with a checkpoint to go on from."""


class Callback:
    """What is called while a run learns. Each method does nothing here: override those that you want.

    They are called between steps of learning, in the process that learns, and are given copies: nothing that they do to
    their arguments reaches a learner. A run with callbacks learns what it learns without, bit for bit, as long as they
    leave the global random generators alone. `StopTraining` stops the run; any other exception ends it and comes out of
    `bootifol.train`, and the run can be resumed from its last checkpoint.
    """

    def on_start(self, directory: Path) -> None:
        """Before the first step, also of a run that is resumed.

        Args:
            directory: of the run.
        """

    def on_log(self, phase: str, count: int, metrics: Mapping[str, float]) -> None:
        """A line was written to `metrics.jsonl` (docs/runs.md says what the metrics are).

        Args:
            phase: "alignment", "cloning" or "interactive".
            count: how far the phase is: gradient steps, or agent steps in "interactive".
            metrics: names and values.
        """

    def on_evaluation(self, agent_steps: int, returns: Mapping[str, float]) -> None:
        """The policy was evaluated: on the way, and once more at the end of the run.

        These are returns of the environment's own reward, which the policy must not learn from. Who stops or chooses by
        them has used the true reward, and says so beside the result.

        Args:
            agent_steps: of training, so far.
            returns: means by name: `evaluation/return_N` of episodes of N agent steps, `evaluation/scaled_return`.
        """

    def on_checkpoint(self, path: Path) -> None:
        """A checkpoint was written.

        Args:
            path: its directory, which the next checkpoint replaces; copy it to keep it.
        """

    def on_end(self, finished: bool) -> None:
        """Nothing comes after it, whether the run came to its end, was stopped, or ended with an error.

        Args:
            finished: whether it came to its end, with its last measurements and its report.
        """


class Callbacks:
    """Several callbacks, called one after the other.

    Args:
        callbacks: in their order.

    Raises:
        BootifolError: one is no `Callback`.
    """

    def __init__(self, callbacks: Sequence[Callback] = ()) -> None:
        for number, callback in enumerate(callbacks):
            if not isinstance(callback, Callback):
                given = (
                    f"the class {callback.__name__}" if isinstance(callback, type) else repr(callback)[:100]
                )
                raise BootifolError(
                    f"callbacks[{number}] is {given} and no bootifol.Callback: derive a class from it, and pass an "
                    "object of that class"
                )
        self._callbacks = tuple(callbacks)

    def __call__(self, event: str, *arguments: Any) -> StopTraining | None:
        """Calls a method of every one.

        Args:
            event: the method's name.
            arguments: of which mappings are copied for each.

        Returns:
            The last `StopTraining` that was raised; None where nobody did.
        """
        stop = None
        for callback in self._callbacks:
            own = [dict(each) if isinstance(each, Mapping) else each for each in arguments]
            try:
                getattr(callback, event)(*own)
            except StopTraining as raised:
                stop = raised
        return stop
