"""Prints a line an evaluation, and stops a run whose agent earns no more.

python examples/stop_early.py TASK DEMOS RUN
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import bootifol


class StopEarly(bootifol.Callback):
    """Stops a run when the learned reward of the agent's episodes has not risen for a while.

    It looks at what the videos taught, not at the environment's own reward: whoever stops by that has used it.

    Args:
        patience: lines of metrics without a new best one.
    """

    def __init__(self, patience: int = 10) -> None:
        self.patience = patience
        self.best, self.since = float("-inf"), 0

    def on_log(self, phase: str, count: int, metrics: Mapping[str, float]) -> None:
        """Compares the learned reward with the best so far."""
        reward = metrics.get("episode/learned_reward")
        if reward is None:
            return
        self.best, self.since = (reward, 0) if reward > self.best else (self.best, self.since + 1)
        if self.since == self.patience:
            raise bootifol.StopTraining(f"after {count} agent steps, the best reward was {self.best:.2f}")


class PrintReturns(bootifol.Callback):
    """Prints what an evaluation found."""

    def on_evaluation(self, agent_steps: int, returns: Mapping[str, float]) -> None:
        """A line of it."""
        found = ", ".join(
            f"{name.removeprefix('evaluation/')} {value:.2f}" for name, value in returns.items()
        )
        print(f"{agent_steps:,} agent steps: {found}")


def learn(task: str, demos: str, run: str, patience: int = 10, **train: Any) -> bool:
    """Trains, and reports what was learned also where the run was stopped.

    Args:
        task: name of the task.
        demos: directory of its videos.
        run: directory to write to.
        patience: of `StopEarly`.
        train: anything else that `bootifol.train` takes, such as `preset="drawn"`.

    Returns:
        Whether the run came to its end.
    """
    callbacks = [PrintReturns(), StopEarly(patience)]
    trained = bootifol.train(task, demos, run, callbacks=callbacks, **train)
    if not trained.finished:
        print(bootifol.report([trained], f"{run}/report.html"))
    return trained.finished


if __name__ == "__main__":
    if len(sys.argv) != 4:
        raise SystemExit(__doc__)
    learn(sys.argv[1], sys.argv[2], sys.argv[3])
