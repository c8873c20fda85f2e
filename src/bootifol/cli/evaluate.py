"""`bootifol evaluate`: how good a trained policy is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console


def evaluate(run: Annotated[Path, tyro.conf.Positional], episodes: int = 10, seed: int = 1000) -> int:
    """Play episodes with a run's newest policy, without exploration, and print their returns.

    Args:
        run: Directory that `bootifol train` wrote.
        episodes: How many, each of the task's evaluation length.
        seed: Of the starts.
    """
    from bootifol.training.api import evaluate_run

    result = evaluate_run(run, episodes, seed)
    console = Console()
    for number, episode in enumerate(result.episodes):
        console.print(f"episode {number}: return {episode.environment_return:.1f}")
    low, high = result.summary.interval or (result.summary.mean, result.summary.mean)
    console.print(
        f"mean return {result.summary.mean:.1f} (95 % interval {low:.1f} to {high:.1f}) over {episodes} episodes of "
        f"{result.episode_steps} agent steps"
    )
    if result.scaled_return is not None:
        console.print(f"scaled return {result.scaled_return:.3f} (0: random actions, 1: the expert)")
    return 0
