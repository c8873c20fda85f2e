"""How soon does the reward rank unseen videos? Alignment alone, variants at equal gradient steps.

    python -m benchmarks.alignment_ranking --demos demos/reacher_hard --steps 200 --out results/alignment_ranking.csv

Held-out expert, half-good and random videos are rewarded against eight expert videos as the preset does. AUC is the
chance that a better video is rewarded above a worse one (0.5: a coin). Beside it, how well the reward follows the true
return of performances of every degree, none of them the expert's own (Spearman; see benchmarks.diagnosis): that is what
an agent needs, and a reward that merely likes smooth motion does not have it.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from rich.console import Console
from scipy import stats

from benchmarks.command import command
from benchmarks.diagnosis import performers
from bootifol.demos.demo_set import DemoSet
from bootifol.envs.pictures import PictureConfig
from bootifol.envs.rollout import play_episode
from bootifol.errors import BootifolError
from bootifol.evaluation.ranking import KINDS, rank_videos, ranking_scores
from bootifol.files import written_aside
from bootifol.malloc import keep_freed_memory
from bootifol.presets import preset
from bootifol.progress import progress
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.rewards.references import draw_references
from bootifol.tasks import make_environment, task_named
from bootifol.types import Video


def variants(config: BootifolConfig) -> dict[str, BootifolConfig]:
    """The preset's reward model, and others by name."""
    return {
        "preset": config,
        "without motion": replace(config, motion=False),
        "without sequence_times": replace(config, sequence_times=1),
        "without both: the paper's network": replace(config, motion=False, sequence_times=1),
    }


def graded(task: str, pictures: PictureConfig, episodes: int) -> tuple[list[Video], list[float]]:
    """Videos and true returns of all performers but the expert itself."""
    environment = make_environment(task, pictures, task_named(task).episode_steps)
    videos, returns = [], []
    for name, make in performers(task, environment).items():
        for seed in range(episodes if name != "expert" else 0):
            played = play_episode(environment, make(seed), 10**6 + seed, f"{name}-{seed}")
            videos.append(played.episode.video)
            returns.append(played.environment_return)
    return videos, returns


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", default="reacher_hard")
    parser.add_argument("--preset", default="cpu")
    parser.add_argument("--demos", type=Path, required=True)
    parser.add_argument("--only", nargs="+", help="these variants alone")
    parser.add_argument("--steps", type=int, default=200, help="gradient steps of each variant")
    parser.add_argument("--every", type=int, default=50, help="gradient steps between two measurements")
    parser.add_argument("--held-out", type=int, default=32)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    keep_freed_memory()
    torch.set_num_threads(arguments.threads)
    sources, held_out = {}, {}
    for kind in KINDS:
        sources[kind], aside = DemoSet.open(arguments.demos / kind).split(arguments.held_out)
        held_out[kind] = [aside[index] for index in range(len(aside))]
    rows: list[dict[str, object]] = []
    chosen = variants(preset(arguments.preset).reward.bootifol)
    if unknown := [name for name in arguments.only or () if name not in chosen]:
        raise BootifolError(f"there is no variant '{unknown[0]}'; the variants are {', '.join(chosen)}")
    if arguments.only:
        chosen = {name: chosen[name] for name in arguments.only}
    video_size = held_out["expert"][0].frames.shape[1]
    pictures = replace(preset(arguments.preset).pictures, video_size=video_size)
    videos, returns = graded(arguments.task, pictures, episodes=8)
    with progress("aligning", total=len(chosen) * arguments.steps) as advance:
        for name, config in chosen.items():
            model = BootifolRewardModel(config, video_size, arguments.seed)
            steps = model.align(sources["expert"], sources["random"])
            recent: list[float] = []
            for step in range(1, arguments.steps + 1):
                recent.append(next(steps)["loss/sequence"])
                advance(1)
                if step % arguments.every:
                    continue
                ranked = rank_videos(
                    model, held_out, sources["expert"], np.random.default_rng(arguments.seed), agent_steps=0
                )
                scores = ranking_scores(ranked)
                rng = np.random.default_rng(arguments.seed)
                learned = [
                    model.label(video, draw_references(model, sources["expert"], rng)).sum()
                    for video in videos
                ]
                rows.append(
                    {
                        "variant": name,
                        "gradient_step": step,
                        "sequence_loss": round(float(np.mean(recent[-arguments.every :])), 4),
                        "kendall_tau": round(scores.kendall_tau, 4),
                        "expert_above_half_good": round(scores.expert_above_half_good, 4),
                        "half_good_above_random": round(scores.half_good_above_random, 4),
                        "graded_spearman": round(float(stats.spearmanr(learned, returns).statistic), 4),
                    }
                )
                Console().print(rows[-1])
                with written_aside(arguments.out) as aside_path, aside_path.open("w", newline="") as file:
                    writer = csv.DictWriter(file, rows[0].keys())
                    writer.writeheader()
                    writer.writerows(rows)


if __name__ == "__main__":
    raise SystemExit(main())
