"""A run directory with invented but plausible numbers: an arm that learns to reach."""

import json
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from bootifol.evaluation.tables import EvaluationRow, RankingRow, append_evaluations, append_ranking
from bootifol.files import write_arrays
from bootifol.types import Arrays, Frames
from bootifol.video_files.writing import write_video

AGENT_STEPS = 60_000
EXPERT_RETURN, RANDOM_RETURN = 48.0, 1.1
LOSSES = {"multiview": 3.6, "triplet": 1.0, "autoencoder": 0.5, "prediction": 3.1, "sequence": 2.8}


def write_synthetic_run(run_dir: Path, seed: int = 1, method: str = "bootifol", final: float = 0.93) -> Path:
    """Writes every file of a run; `final` is the scaled return it ends with."""
    run_dir.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    _write_config(run_dir, seed, method)
    _write_metrics(run_dir, rng, final)
    _write_evaluations(run_dir, rng, final)
    _write_ranking(run_dir, rng)
    _write_showcase(run_dir, rng, final)
    return run_dir


def _write_config(run_dir: Path, seed: int, method: str) -> None:
    config = {
        "format": 1,
        "task": "reacher_hard",
        "method": method,
        "preset": "cpu",
        "seed": seed,
        "demos": "demos/reacher_hard",
        "command": f"bootifol train --task reacher_hard --method {method} --preset cpu "
        f"--demos demos/reacher_hard --out runs/{run_dir.name} --seed {seed}",
        "config": {
            "training": {"agent_steps": AGENT_STEPS, "alignment_steps": 2000, "update_every": 50},
            "reward": {
                "temperature": 0.07,
                "reward": "distance",
                "weights": {"multiview": 1.0, "triplet": 1.0},
            },
            "agent": {
                "batch_size": 128,
                "learning_rate": 1e-4,
                "n_step": 3,
                "stddev": "linear(1.0, 0.1, 20000)",
            },
            "pictures": {"agent_size": 64, "video_size": 64, "stack": 3, "profile": "fast"},
        },
        "versions": {"bootifol": "0.1.0", "python": "3.11.7", "torch": "2.13.0", "mujoco": "3.3.0"},
    }
    (run_dir / "config.json").write_text(json.dumps(config))


def _write_metrics(run_dir: Path, rng: np.random.Generator, final: float) -> None:
    lines = []
    for step in range(0, 2000, 10):
        record = {"phase": "alignment", "gradient_step": step, "seconds": 0.7 * step}
        for name, start in LOSSES.items():
            record[f"loss/{name}"] = start * (0.12 + 0.88 * np.exp(-step / 400)) * rng.normal(1, 0.08)
        record["loss/total"] = sum(record[f"loss/{name}"] for name in LOSSES)
        lines.append(json.dumps(record))
    for step in range(960, AGENT_STEPS + 1, 120):
        progress = step / AGENT_STEPS
        record = {"phase": "interactive", "agent_steps": step, "seconds": 1400 + 7000 * progress}
        for name, start in LOSSES.items():
            record[f"loss/{name}"] = start * 0.12 * (1 - 0.4 * progress) * rng.normal(1, 0.1)
        record["loss/sequence"] = max(
            0.0, 0.3 * np.exp(-progress * 8) + 0.25 * progress + rng.normal(0, 0.02)
        )
        record["loss/total"] = sum(record[f"loss/{name}"] for name in LOSSES)
        record["episode/learned_reward"] = -1.9 + 1.3 * final * _learned(progress) + rng.normal(0, 0.12)
        record["agent/critic_loss"] = 0.05 + 0.1 * np.exp(-progress * 3) * rng.normal(1, 0.1)
        record["agent/actor_loss"] = 4.0 - 3.0 * _learned(progress) + rng.normal(0, 0.1)
        lines.append(json.dumps(record))
    (run_dir / "metrics.jsonl").write_text("\n".join(lines) + "\n")


def _learned(progress: float) -> float:
    return float(1 / (1 + np.exp(-(progress - 0.4) * 11)))


def _write_evaluations(run_dir: Path, rng: np.random.Generator, final: float) -> None:
    rows = []
    for step in range(0, AGENT_STEPS + 1, 3000):
        for length in (60, 500):
            for episode in range(10):
                scaled = final * _learned(step / AGENT_STEPS) + rng.normal(0, 0.09)
                scale = length / 60
                rows.append(
                    EvaluationRow(
                        agent_steps=step,
                        seconds=1400 + 7000 * step / AGENT_STEPS,
                        episode_steps=length,
                        episode=episode,
                        seed=10_000 + episode,
                        environment_return=scale * (RANDOM_RETURN + scaled * (EXPERT_RETURN - RANDOM_RETURN)),
                        # Expert and random agent were measured at the length of the evaluation alone.
                        scaled_return=scaled if length == 500 else None,
                        success=bool(scaled > 0.5),
                    )
                )
    append_evaluations(run_dir / "evaluations.csv", rows)


def _write_ranking(run_dir: Path, rng: np.random.Generator) -> None:
    for step, sharpness in ((0, 1.0), (AGENT_STEPS, 1.8)):
        means = {"random": -100.0, "half_good": -78.0, "expert": -55.0}
        if step:
            means["agent"] = -60.0
        rows = [
            RankingRow(step, kind, f"{kind}-{i:03d}", float(mean + rng.normal(0, 14 / sharpness)))
            for kind, mean in means.items()
            for i in range(20)
        ]
        append_ranking(run_dir / "ranking.csv", rows)


def _write_showcase(run_dir: Path, rng: np.random.Generator, final: float) -> None:
    arrays: Arrays = {}
    (run_dir / "videos").mkdir()
    for start in range(3):
        first, goal = rng.uniform(-3, 3, 2), rng.uniform(-1.5, 1.5, 2)
        for kind, speed in (("expert", 0.16), ("agent", 0.13 * final), ("random", 0.0)):
            frames, distance = _reach(rng, first, goal, speed)
            arrays[f"frames/{kind}/{start}"] = frames
            arrays[f"reward/{kind}/{start}"] = (-0.3 - distance[1:] + rng.normal(0, 0.04, 60)).astype(
                np.float32
            )
            arrays[f"environment_return/{kind}/{start}"] = np.array([float((distance[1:] < 0.3).sum())])
            arrays[f"seed/{kind}/{start}"] = np.array([500 + start])
            write_video(run_dir / "videos" / f"{kind}-{start}.mp4", frames, 20.0)
    write_arrays(run_dir / "showcase.safetensors", arrays)


def _reach(
    rng: np.random.Generator, angles: np.ndarray, goal: np.ndarray, speed: float, size: int = 64
) -> tuple[Frames, np.ndarray]:
    """61 pictures of a two-link arm, and its distance from the goal."""
    frames, distance = [], []
    angles = angles.copy()
    for _ in range(61):
        picture = Image.new("RGB", (size * 2, size * 2), (42, 62, 92))
        draw = ImageDraw.Draw(picture)
        elbow, hand = _joints(angles, size)
        target = _joints(goal, size)[1]
        draw.ellipse([target[0] - 6, target[1] - 6, target[0] + 6, target[1] + 6], fill=(200, 40, 50))
        draw.line([(size, size), tuple(elbow), tuple(hand)], fill=(222, 184, 92), width=7, joint="curve")
        draw.ellipse([hand[0] - 5, hand[1] - 5, hand[0] + 5, hand[1] + 5], fill=(240, 210, 120))
        frames.append(np.asarray(picture.resize((size, size), Image.Resampling.BOX)))
        distance.append(float(np.linalg.norm(hand - target)) / size)
        angles += speed * (goal - angles) + (rng.normal(0, 0.25, 2) if speed == 0 else rng.normal(0, 0.01, 2))
    return np.stack(frames), np.array(distance)


def _joints(angles: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    elbow = size + 0.42 * size * np.array([np.cos(angles[0]), np.sin(angles[0])])
    return elbow, elbow + 0.42 * size * np.array([np.cos(angles.sum()), np.sin(angles.sum())])
