"""Small run directories with numbers chosen by hand: what tables and the paper's figures read."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bootifol.evaluation.tables import EvaluationRow, append_evaluations

STEPS = 1000
"""Agent steps of a run."""

LEVELS = {"random": 0.0, "expert": 100.0}


def write_run(
    run_dir: Path,
    returns: Sequence[float] = (40.0, 60.0),
    *,
    task: str = "reacher_hard",
    method: str = "bootifol",
    seed: int = 1,
    agent_steps: int = STEPS,
    curve: Mapping[int, Sequence[float]] | None = None,
    seconds: float = 60.0,
    time_budget: float | None = None,
    final_episodes: int | None = None,
    levels: Mapping[str, float] | None = LEVELS,
    losses: Mapping[str, Sequence[float]] | None = None,
    versions: Mapping[str, str] | None = None,
    videos: Mapping[str, Mapping[str, Any]] | None = None,
    **changes: Any,
) -> Path:
    """A run that ended after `agent_steps` with these returns of 500-step episodes.

    Args:
        run_dir: where.
        returns: of the final episodes; none leaves the final evaluation out.
        task: its name.
        method: its name.
        seed: of the run.
        agent_steps: how far it has come; the configuration says 1000.
        curve: returns of 60-step episodes by agent steps.
        seconds: how long it took.
        time_budget: as in config.json.
        final_episodes: as in config.json; by default as many as there are.
        levels: of the scale.
        losses: values by name, logged in both phases at steps 10, 20, ...
        versions: as in config.json, where they differ from a usual run's.
        videos: as in config.json.
        changes: fields of the configuration by dotted name, with __ for the dot.
    """
    config: dict[str, Any] = {
        "reward": {"bootifol": {"reward": "distance"}, "context_translation": {"references": 10}},
        "agent": {"batch_size": 128},
        "alignment": {"gradient_steps": 500},
        "interactive": {"agent_steps": STEPS, "reward_updates_until": 500},
        "evaluation": {"final_episodes": len(returns) if final_episodes is None else final_episodes},
        "tensorboard": True,
    }
    for name, value in changes.items():
        *sections, field = name.split("__")
        section = config
        for each in sections:
            section = section.setdefault(each, {})
        section[field] = value
    header = {
        "format": 1,
        "task": task,
        "method": method,
        "preset": "cpu",
        "seed": seed,
        "demos": f"demos/{task}",
        "time_budget": time_budget,
        "command": ["bootifol", "train"],
        "config": config,
        "versions": {"bootifol": "0.1.0", "torch": "2.13.0", "code": "abc123"} | (versions or {}),
        "videos": videos or {},
    }
    run_dir.mkdir(parents=True)
    (run_dir / "config.json").write_text(json.dumps(header))
    rows = [
        _row(steps, 60, number, value, seconds * steps / STEPS, None)
        for steps, values in (curve or {}).items()
        for number, value in enumerate(values)
    ]
    rows += [_row(agent_steps, 500, number, value, seconds, levels) for number, value in enumerate(returns)]
    if rows:
        append_evaluations(run_dir / "evaluations.csv", rows)
    _write_metrics(run_dir, losses or {}, agent_steps, seconds)
    return run_dir


def _row(
    agent_steps: int,
    length: int,
    number: int,
    value: float,
    seconds: float,
    levels: Mapping[str, float] | None,
) -> EvaluationRow:
    scaled = None
    if levels is not None:
        scaled = (value - levels["random"]) / (levels["expert"] - levels["random"])
    return EvaluationRow(agent_steps, seconds, length, number, 7 + number, value, scaled, None)


def _write_metrics(
    run_dir: Path, losses: Mapping[str, Sequence[float]], agent_steps: int, seconds: float
) -> None:
    records: list[dict[str, Any]] = []
    for phase, counter in (("alignment", "gradient_step"), ("interactive", "agent_steps")):
        for number in range(max([0, *map(len, losses.values())])):
            told = {f"loss/{name}": values[number] for name, values in losses.items() if number < len(values)}
            records.append({"phase": phase, counter: 10 * (number + 1), "seconds": 1.0, **told})
    records.append({"phase": "interactive", "agent_steps": agent_steps, "seconds": seconds, "agent/q": 1.0})
    (run_dir / "metrics.jsonl").write_text("".join(json.dumps(record) + "\n" for record in records))
