"""Runs of a sweep as they are planned, as they are written, and as a file names them; each of seconds."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

from bootifol.evaluation.tables import EvaluationRow, append_evaluations
from bootifol.sweep.planned import PlannedRun

OVERRIDES = (("interactive.agent_steps", 240), ("agent.warm_up_steps", 60), ("evaluation.final_episodes", 1))
RUN = PlannedRun("drawn_home", preset="smoke", overrides=OVERRIDES)


def write_config(run: Path, planned: PlannedRun = RUN) -> None:
    run.mkdir(parents=True, exist_ok=True)
    header = {"task": planned.task, "method": planned.method, "preset": planned.preset, "seed": planned.seed}
    config = dataclasses.asdict(planned.config)
    (run / "config.json").write_text(json.dumps(header | {"time_budget": planned.seconds, "config": config}))


def write_end(run: Path, seconds: float) -> None:
    """What a run that has ended leaves."""
    line = {"phase": "interactive", "agent_steps": 240, "seconds": seconds}
    (run / "metrics.jsonl").write_text(json.dumps(line) + "\n")
    append_evaluations(run / "evaluations.csv", [EvaluationRow(240, seconds, 60, 0, 7, 50.0, 1.0, True)])
    (run / "report.html").write_text("a report")


TINY = """
pictures.agent_size: 32
pictures.video_size: 32
reward.bootifol.width_divisor: 32
reward.bootifol.videos_per_class: 2
agent.encoder: strided
agent.update_every: 10
agent.batch_size: 8
agent.warm_up_steps: 60
alignment.gradient_steps: 4
interactive.agent_steps: 240
interactive.log_every: 30
evaluation.every: 1000
evaluation.long_episodes: 1
evaluation.showcase_episodes: 1
evaluation.final_episodes: 1
evaluation.held_out_videos: 2
evaluation.sight_episodes: 0
demonstrations.fraction: 0.0
agent.cloning_weight: 0.0
tracker: none
"""
"""Fields of a run of seconds."""


def tiny_sweep(path: Path, demos: Path, methods: str, more: str = "") -> Path:
    """Writes the file of a sweep of tiny runs; `more` are other fields of theirs, and more keys where not indented."""
    fields = "".join(
        f"    {line}\n" for line in TINY.strip().splitlines() if f"{line.partition(':')[0]}:" not in more
    )
    path.write_text(
        f"tasks: drawn_home\nmethods: {methods}\npresets: smoke\ndemos: {demos}\nvariants:\n  default:\n{fields}{more}"
    )
    return path
