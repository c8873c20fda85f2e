"""What must a clone see, and of what, to act and not to freeze? True actions of the expert, cloned in four ways.

    python -m benchmarks.cloning --task reacher_hard --out results/reacher_hard/cloning.csv

Here the actions are the expert's own, so that nothing but the cloning is measured; `bootifol train` infers them. What
differs is which transitions are drawn (uniformly, or 80 % of them where the picture moves) and how many of their stacks
keep their history. Acting always sees whole stacks. Finished rows are kept: the same command goes on where it stopped.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from rich.console import Console

from benchmarks.command import command
from benchmarks.resumable_table import ResumableTable
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.inverse_dynamics import InverseDynamics
from bootifol.envs.rollout import play_episode
from bootifol.evaluation.returns import evaluate, evaluation_seeds
from bootifol.experts import make_expert
from bootifol.presets import preset
from bootifol.progress import progress
from bootifol.replay.buffer import ReplayBuffer
from bootifol.tasks import make_environment, task_named
from bootifol.training.cloning import one_cycle
from bootifol.training.config import DemonstrationConfig, TrainingConfig
from bootifol.training.inferred_demonstrations import Demonstrations
from bootifol.training.interactive import episode_seed
from bootifol.types import Episode, FrameBatch, Video

VARIANTS = {
    "drawn uniformly, whole history": (None, 0.0),
    "moving, whole history": (0.8, 0.0),
    "moving, 80 % without history": (0.8, 0.8),
    "moving, all without history": (0.8, 1.0),
}
"""Fraction of the transitions in which the picture moves (None: as they come), and of the stacks without history."""
COLUMNS = ("variant", "seed", "updates", "cloning_loss", "mean_return", "episodes_above_half")


class Recorded:
    """Expert episodes as a source of videos."""

    def __init__(self, episodes: list[Episode]) -> None:
        self.episodes = episodes

    def __len__(self) -> int:
        return len(self.episodes)

    def __getitem__(self, index: int) -> Video:
        return Video(f"expert-{index}", self.episodes[index].frames)

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        raise NotImplementedError("cloning draws transitions, not videos")


@command(resumes=True)
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", default="reacher_hard")
    parser.add_argument("--preset", default="cpu", help="whose agent and pictures")
    parser.add_argument("--videos", type=int, default=1000, help="expert episodes to clone")
    parser.add_argument("--updates", type=int, default=4000, help="gradient steps of each variant")
    parser.add_argument("--episodes", type=int, default=20, help="to judge each clone by, 60 steps each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--variants", nargs="+", default=list(VARIANTS), choices=list(VARIANTS))
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    results = ResumableTable(arguments.out, COLUMNS)
    config = preset(arguments.preset)
    episodes = expert_episodes(arguments.task, config, arguments.videos, arguments.seed)
    for variant in arguments.variants:
        if not results.has(variant, arguments.seed):
            results.add(cloned(variant, episodes, config, arguments))
    Console().print(results.shown())


def expert_episodes(task: str, config: TrainingConfig, count: int, seed: int) -> list[Episode]:
    """Episodes of the bundled expert, with its actions."""
    environment = make_environment(task, config.pictures, task_named(task).episode_steps)
    expert = make_expert(task, environment)
    episodes = []
    with progress("recording the expert", count) as advance:
        for number in range(count):
            episodes.append(play_episode(environment, expert, episode_seed(seed, number), "expert").episode)
            advance(1)
    environment.close()
    return episodes


def cloned(
    variant: str, episodes: list[Episode], config: TrainingConfig, arguments: argparse.Namespace
) -> dict[str, str]:
    """One clone and what it earns."""
    moving_fraction, history_dropout = VARIANTS[variant]
    size, stack, steps = config.pictures.agent_size, config.pictures.stack, episodes[0].agent_steps
    action_dim = episodes[0].actions.shape[1]
    agent = DrQv2(config.agent, size, stack, action_dim, arguments.seed)
    replay = ReplayBuffer(
        len(episodes) * (steps + 1), size, action_dim, stack, shift=config.agent.random_shift
    )
    demonstrations = Demonstrations(
        DemonstrationConfig(
            fraction=0.5,
            videos=len(episodes),
            moving_fraction=moving_fraction or 0.0,
            history_dropout=history_dropout,
        ),
        Recorded(episodes),
        replay,
        InverseDynamics(config.agent.encoder, size, stack, 1, action_dim, arguments.seed),
        size,
        action_dim,
    )
    for episode_id, episode in zip(replay.episode_ids, episodes, strict=True):
        replay.relabel(episode_id, np.zeros(steps, np.float32), episode.actions)
    rng = np.random.default_rng(arguments.seed)
    losses = []
    with progress(f"cloning: {variant}", arguments.updates) as advance:
        for done in range(arguments.updates):
            draw = replay.sample if moving_fraction is None else demonstrations.sample
            learning_rate = demonstrations.config.cloning_learning_rate * one_cycle(done, arguments.updates)
            batch = draw(config.agent.batch_size, rng)
            losses.append(float(agent.clone(batch, learning_rate)["agent/cloning_loss"]))
            advance(1, loss=losses[-1])
    environment = make_environment(arguments.task, config.pictures, steps)
    results = evaluate(
        environment,
        lambda observation: agent.act(observation, 0, explore=False),
        evaluation_seeds(arguments.seed, arguments.episodes),
    )
    environment.close()
    returns = np.array([result.environment_return for result in results])
    expert = evaluate_expert(arguments, config, steps)
    return {
        "variant": variant,
        "seed": str(arguments.seed),
        "updates": str(arguments.updates),
        "cloning_loss": f"{np.mean(losses[-500:]):.4f}",
        "mean_return": f"{returns.mean():.1f} of {expert.mean():.1f}",
        "episodes_above_half": f"{(returns > expert / 2).mean():.2f}",
    }


def evaluate_expert(arguments: argparse.Namespace, config: TrainingConfig, steps: int) -> np.ndarray:
    """Returns of the expert from the same starts."""
    environment = make_environment(arguments.task, config.pictures, steps)
    results = evaluate(
        environment,
        make_expert(arguments.task, environment),
        evaluation_seeds(arguments.seed, arguments.episodes),
    )
    environment.close()
    return np.array([result.environment_return for result in results])


if __name__ == "__main__":
    raise SystemExit(main())
