"""Random actions, evaluated and written down like a run: the lower end of the scale in tables and figures.

    python -m bootifol.sweep.random_actions --task reacher_hard --demos demos/reacher_hard --out runs/random

It takes the words of `bootifol train`; nothing is learned, so there are no checkpoints and no curves.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from bootifol.cli.train import preset_of
from bootifol.envs.rollout import Act
from bootifol.errors import BootifolError
from bootifol.evaluation.returns import EpisodeResult, evaluate, evaluation_rows, evaluation_seeds
from bootifol.evaluation.tables import append_evaluations
from bootifol.experts import make_random
from bootifol.progress import progress
from bootifol.reports.html import report
from bootifol.training.build import build_environment
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig


def play(
    config: Annotated[TrainingConfig, tyro.conf.arg(name="")],
    task: str,
    demos: Path,
    out: Path,
    preset: str = "cpu",
    seed: int = 1,
    time_budget: str | None = None,
    words: Annotated[tuple[str, ...], tyro.conf.Fixed, tyro.conf.Suppress] = (),
) -> None:
    """Plays the final evaluation of a run with random actions; `time_budget` changes nothing."""
    run = RunConfig(task, "random", preset, seed, str(demos), None, config)
    resolved = run.resolved_task()
    environment = build_environment(run, resolved.evaluation_steps)
    run.write(out, ["python", "-m", "bootifol.sweep.random_actions", *words])
    act: Act = make_random(environment, seed)
    results: list[EpisodeResult] = []
    with progress("random actions", config.evaluation.final_episodes) as advance:
        for start in evaluation_seeds(seed, config.evaluation.final_episodes):
            results += evaluate(environment, act, [start])
            advance(1)
    environment.close()
    rows = evaluation_rows(
        results,
        agent_steps=0,
        seconds=0.0,
        episode_steps=resolved.evaluation_steps,
        expert_return=resolved.expert_return,
        random_return=resolved.random_return,
    )
    append_evaluations(out / "evaluations.csv", rows)
    report([out], out / "report.html")


def main(words: Sequence[str]) -> int:
    """The command.

    Returns:
        0, or 2 after bad input, which one sentence explains.
    """
    try:
        tyro.cli(
            functools.partial(play, config=preset_of([*words, "--method", "random"]), words=tuple(words)),
            args=words,
            config=(tyro.conf.FlagConversionOff, tyro.conf.AvoidSubcommands),
        )
    except BootifolError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
