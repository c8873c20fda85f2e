"""Puts an expert that `bootifol experts train` has trained into the package, and one half as good beside it.

    python -m benchmarks.bundle_expert experts/hopper_stand

A training evaluates a policy on few starts, and the best of many such evaluations is partly the luckiest. So the
policies that its curve names best are judged again, on more starts that neither the curve nor the tables of returns
know; and so are those whose returns are nearest to half of the winner's.

Beside `TASK.safetensors` and `TASK.half_trained.safetensors` lie `TASK.csv`, the curve of the training, and
`TASK.json`, what it was trained with and how the two were judged.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.command import command
from benchmarks.rows import Row, read_rows
from bootifol.errors import BootifolError, require_at_least
from bootifol.experts import BUNDLED
from bootifol.experts.policy import StatePolicy
from bootifol.experts.states import StateEnvironment
from bootifol.experts.train import COLUMNS, EVALUATION_SEED, evaluate_policy
from bootifol.files import read_json, write_json
from bootifol.progress import progress
from bootifol.tasks import task_named

JUDGING_SEED = 2 * EVALUATION_SEED
"""Seeds of the starts on which candidates are judged begin here."""


def judge(trained: Path, task: str, candidates: list[Row], episodes: int, what: str) -> dict[int, float]:
    """Mean returns of the policies of these evaluations, by their agent steps."""
    environment = StateEnvironment(task, task_named(task).evaluation_steps)
    means: dict[int, float] = {}
    with progress(f"judging {what} policies of {task}", len(candidates)) as advance:
        for row in candidates:
            policy = StatePolicy.load(trained / "policies" / f"{row['agent_steps']}.safetensors")
            returns = evaluate_policy(policy, environment, episodes, first_seed=JUDGING_SEED)
            means[int(row["agent_steps"])] = float(np.mean(returns))
            advance(1, mean_return=means[int(row["agent_steps"])])
    environment.close()
    return means


def bundle(trained: Path, candidates: int, episodes: int, out: Path) -> dict[str, Any]:
    """Chooses, copies and describes; returns the description.

    Args:
        trained: what `bootifol experts train` wrote.
        candidates: policies judged for either place.
        episodes: starts that each is judged on.
        out: where the four files go.

    Raises:
        BootifolError: there is no such training, or its curve is empty.
    """
    training = read_json(trained / "training.json", "the expert's training")
    task = training["config"]["task"]
    curve = read_rows(trained / "curve.csv", COLUMNS)
    if not curve:
        raise BootifolError(f"{trained} has no evaluation yet: go on with bootifol experts train")

    praised = sorted(curve, key=lambda row: -float(row["mean_return"]))[:candidates]
    best = judge(trained, task, praised, episodes, "the best")
    expert = max(best, key=lambda steps: best[steps])
    wanted = best[expert] / 2
    nearest = sorted(curve, key=lambda row: abs(float(row["mean_return"]) - wanted))[:candidates]
    halves = judge(trained, task, nearest, episodes, "half-trained")
    half = min(halves, key=lambda steps: abs(halves[steps] - wanted))
    described: dict[str, Any] = training | {
        "judged_episodes": episodes,
        "expert": {"agent_steps": expert, "mean_return": round(best[expert], 2)},
        "half_trained": {"agent_steps": half, "mean_return": round(halves[half], 2)},
    }
    out.mkdir(parents=True, exist_ok=True)
    for name, steps in ((task, expert), (f"{task}.half_trained", half)):
        StatePolicy.load(trained / "policies" / f"{steps}.safetensors").save(out / f"{name}.safetensors")
    shutil.copyfile(trained / "curve.csv", out / f"{task}.csv")
    write_json(out / f"{task}.json", described)
    return described


@command()
def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("trained", type=Path, help="a directory that bootifol experts train wrote")
    parser.add_argument("--candidates", type=int, default=5, help="policies judged for either place")
    parser.add_argument("--episodes", type=int, default=50, help="starts that each is judged on")
    parser.add_argument("--out", type=Path, default=BUNDLED)
    arguments = parser.parse_args(argv)
    require_at_least(1, candidates=arguments.candidates, episodes=arguments.episodes)
    described = bundle(arguments.trained, arguments.candidates, arguments.episodes, arguments.out)
    for who in ("expert", "half_trained"):
        print(f"{who}: {described[who]['mean_return']} after {described[who]['agent_steps']} agent steps")


if __name__ == "__main__":
    raise SystemExit(main())
