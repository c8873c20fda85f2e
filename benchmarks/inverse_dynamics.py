"""How well does a run infer the expert's actions? Beside the true ones, which the run never saw.

    python -m benchmarks.inverse_dynamics runs/reacher_hard --episodes 60

A clone can be no better than the actions it is given. Near the goal the expert's actions are small, so that an error
there turns them around: the clone comes to rest beside the goal.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.command import command
from bootifol.envs.rollout import play_episode
from bootifol.errors import BootifolError
from bootifol.evaluation.returns import evaluation_seeds
from bootifol.experts import make_expert
from bootifol.progress import progress
from bootifol.training.build import build_environment
from bootifol.training.inferred_demonstrations import moving_steps
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer

SMALL = 0.3
"""Actions below this in every dimension are small: the expert approaches its goal or corrects."""


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, help="a run with demonstrations")
    parser.add_argument("--episodes", type=int, default=60, help="of the bundled expert")
    arguments = parser.parse_args()
    console = Console()
    run = Trainer(RunConfig.read(arguments.run), arguments.run, console)
    demonstrations = run.parts.demonstrations
    if demonstrations is None:
        raise BootifolError(f"{arguments.run} has no demonstrations, so it inferred no actions")
    environment = build_environment(run.config, run.task.episode_steps)
    expert = make_expert(run.config.task, environment)
    moving, errors, actions = [], [], []
    with progress("comparing with the expert's actions", arguments.episodes) as advance:
        for seed in evaluation_seeds(run.config.seed, arguments.episodes):
            episode = play_episode(environment, expert, seed, "expert").episode
            inferred = demonstrations.inverse_dynamics.actions(episode.frames)
            moving.append(moving_steps(episode.frames))
            errors.append(inferred - episode.actions)
            actions.append(episode.actions)
            advance(1)
    console.print(table(np.concatenate(moving), np.concatenate(errors), np.concatenate(actions)))


def table(moving: NDArray[np.bool_], error: NDArray[np.float32], action: NDArray[np.float32]) -> Table:
    """Squared errors by what the expert does: booleans `[N]`, errors and true actions `[N, A]`."""
    small = np.abs(action).max(axis=1) < SMALL
    shown = Table("the expert …", "steps", "mean squared action", "mean squared error", "mean error")
    rows = {"moves": moving, f"moves, actions below {SMALL}": moving & small, "keeps still": ~moving}
    for name, chosen in rows.items():
        if not chosen.any():
            continue
        shown.add_row(
            name,
            str(int(chosen.sum())),
            f"{np.square(action[chosen]).mean():.4f}",
            f"{np.square(error[chosen]).mean():.4f}",
            " ".join(f"{value:+.3f}" for value in error[chosen].mean(axis=0)),
        )
    return shown


if __name__ == "__main__":
    raise SystemExit(main())
