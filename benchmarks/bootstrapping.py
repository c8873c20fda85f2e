"""Does bootstrapping leave the agent's successes their reward? From a run that has ended, in minutes.

    python -m benchmarks.bootstrapping runs/plate --out results/bootstrapping.csv \\
        --head noise=0.3,exchange_weight=1 --head noise=0.3,exchange_weight=1,agent_weight=0.1

The run's policy plays, half of the episodes with noise on its actions, and each of its steps is judged twice: by the
environment, which alone says what a success is, and by the learned reward. The first row is the head that the run ended
with. Then the same eyes get new heads, which learn from the run's own agent videos, with other numbers of FrameConfig.

Only steps after half of a video's length count. One is a success where the environment gives at least 0.8 of what it
gives the expert there, and a failure below half of that. Columns: mean learned reward of the expert's late frames, of
successes and of failures; the chances (AUC) that a success is rewarded above a failure, and a late frame of the
expert's above a success; the rank correlation of both rewards over the agent's steps. Wanted: success above failure at
least 0.9, expert above success at most 0.65.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from scipy import stats

from benchmarks.command import command
from benchmarks.probe import with_fields
from benchmarks.rows import Row, read_rows, write_rows
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import find_demo_sets
from bootifol.envs.rollout import play_episode
from bootifol.errors import BootifolError
from bootifol.evaluation.ranking import area_under_curve
from bootifol.evaluation.sight import FIRST_SEED
from bootifol.experts import make_expert
from bootifol.progress import progress
from bootifol.replay.agent_videos import AgentVideos
from bootifol.reports.markdown import markdown_table
from bootifol.rewards.bootifol.frames.config import FrameConfig
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.tasks import make_environment
from bootifol.training.build import build_reward_model
from bootifol.training.checkpoint import load_checkpoint
from bootifol.training.run_config import RunConfig
from bootifol.training.saved_policy import require_checkpoint, restored_agent
from bootifol.types import Action, Arrays, FrameStates, Observation, Rewards

COLUMNS = (
    "task",
    "run",
    "head",
    "expert",
    "success",
    "failure",
    "success_above_failure",
    "expert_above_success",
    "spearman",
)
SUCCESS, FAILURE = 0.8, 0.5
"""Of what the environment gives the expert, late in its episodes."""

ACTION_NOISE = 0.4
"""Standard deviation of the noise on the actions of every other episode: what lies beside the policy's own path."""

LEVEL_EPISODES = 4
"""Of the expert, which say what the environment gives it."""


@dataclass(frozen=True)
class Played:
    """What a run's policy did."""

    states: FrameStates
    """Of the agent's frames after half of a video's length, `[E, T, Z]`."""

    rewards: Rewards
    """The environment's, `[E, T]`."""

    level: float
    """What the environment gives the expert, late in a video's length."""


def play(
    directory: Path, run: RunConfig, model: FrameRewardModel, episodes: int, steps: int, length: int
) -> Played:
    """Policy and expert play.

    Args:
        directory: of the run.
        run: its configuration.
        model: whose eyes see the frames.
        episodes: of the policy.
        steps: of each.
        length: of a video, in agent steps.
    """
    environment = make_environment(run.task, run.training.pictures, steps, run.training.action_repeat)
    agent, progressed = restored_agent(run, directory, environment)
    rng = np.random.default_rng(0)

    def performed(act: Callable[[Observation], Action], episode: int) -> tuple[FrameStates, Rewards]:
        played = play_episode(environment, act, FIRST_SEED + episode, "agent", keep_environment_rewards=True)
        video = played.episode.video
        assert video.environment_rewards is not None
        return model.states(video.frames)[1:], video.environment_rewards

    def act_with(noise: float, observation: Observation) -> Action:
        action = agent.act(observation, progressed.counters.agent_steps, explore=False)
        return (action + noise * rng.standard_normal(action.shape)).clip(-1, 1).astype(np.float32)

    states: list[FrameStates] = []
    rewards: list[Rewards] = []
    late: list[float] = []
    with progress("policy and expert play", episodes + LEVEL_EPISODES) as advance:
        for episode in range(episodes):
            noise = ACTION_NOISE if episode % 2 else 0.0
            seen, given = performed(partial(act_with, noise), episode)
            states.append(seen)
            rewards.append(given)
            advance(1)
        for episode in range(LEVEL_EPISODES):
            _, given = performed(make_expert(run.task, environment), episode)
            late.extend(given[length // 2 : length])
            advance(1)
    half = length // 2
    return Played(np.stack(states)[:, half:], np.stack(rewards)[:, half:], float(np.median(late)))


def figures(model: FrameRewardModel, played: Played, expert: FrameStates) -> dict[str, float]:
    """The columns of numbers.

    Args:
        model: whose head is judged.
        played: what the policy did.
        expert: states of late frames of the expert's.

    Raises:
        BootifolError: the policy has only successes, or only failures.
    """
    flat = played.states.reshape(-1, played.states.shape[-1])
    learned = model.score(flat).reshape(played.rewards.shape).astype(np.float64)
    success = learned[played.rewards >= SUCCESS * played.level]
    failure = learned[played.rewards < FAILURE * played.level]
    if min(len(success), len(failure)) < 20:
        raise BootifolError(
            f"of the policy's {learned.size} steps {len(success)} are successes and {len(failure)} failures: both are "
            "needed, so take a run that has learned something, or --episodes of more"
        )
    of_expert = model.score(expert).astype(np.float64)
    return {
        "expert": float(of_expert.mean()),
        "success": float(success.mean()),
        "failure": float(failure.mean()),
        "success_above_failure": area_under_curve(success, failure),
        "expert_above_success": area_under_curve(of_expert, success),
        "spearman": float(stats.spearmanr(learned.ravel(), played.rewards.ravel()).statistic),
    }


def late_frames(model: FrameRewardModel, expert: DemoSet, videos: int = 50) -> FrameStates:
    """States of the second half of some of the expert's videos, `[N, Z]`."""
    frames: list[NDArray[np.uint8]] = [expert[index].frames for index in range(min(videos, len(expert)))]
    return np.concatenate([model.states(of_video[len(of_video) // 2 :]) for of_video in frames])


def with_new_head(config: FrameConfig, run: RunConfig, state: Arrays) -> FrameRewardModel:
    """A reward model with the run's eyes, from its `state`, and a head that has learned nothing."""
    model = FrameRewardModel(config, run.training.pictures.video_size, run.seed)
    new = deepcopy(model.networks.head.state_dict())
    model.load_state({name: array.copy() for name, array in state.items()})
    model.networks.head.load_state_dict(new)
    return model


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, help="directory of a run whose reward sees single frames")
    parser.add_argument("--head", action="append", default=[], help="NAME=NUMBER,…: a new head with these")
    parser.add_argument("--updates", type=int, default=3000, help="of each such head")
    parser.add_argument("--episodes", type=int, default=12, help="that the policy plays")
    parser.add_argument("--steps", type=int, default=240, help="of each episode")
    parser.add_argument("--out", type=Path, required=True, help="CSV to write rows into")
    options = parser.parse_args(arguments)
    run = RunConfig.read(options.run)
    model = build_reward_model(run)
    if not isinstance(model, FrameRewardModel):
        raise BootifolError(
            f"{options.run} has no reward from single frames: it needs reward.bootifol.reward frames"
        )
    configs = [with_fields(model.config, head.split(",")) for head in options.head]
    episode_frames = run.resolved_task().episode_steps + 1
    ring = AgentVideos(
        run.training.interactive.agent_videos,
        episode_frames,
        run.training.pictures.video_size,
        model.feature_size,
        feature_bytes=1,
    )
    load_checkpoint(require_checkpoint(options.run), {"reward_model": model, "agent_videos": ring})
    expert = DemoSet.open(find_demo_sets(Path(run.demos))["expert"], verify=False)
    length = len(expert[0].frames) - 1
    played = play(options.run, run, model, options.episodes, options.steps, length)
    late = late_frames(model, expert)
    named = [("as the run left it", figures(model, played, late))]
    kept = {name: array.copy() for name, array in model.state().items()}
    for head, config in zip(options.head, configs, strict=True):
        other = with_new_head(config, run, kept)
        with progress(f"a head with {head}", options.updates) as advance:
            for _ in range(options.updates):
                other.update(expert, ring)
                advance(1)
        named.append((head, figures(other, played, late)))
    key = {"task": run.task, "run": str(options.run)}
    rows: list[Row] = [
        row for row in read_rows(options.out, COLUMNS) if any(row[name] != key[name] for name in key)
    ]
    new = [{**key, "head": head, **{name: f"{x:.4f}" for name, x in of.items()}} for head, of in named]
    write_rows(options.out, COLUMNS, [*rows, *new])
    cells = [(head, *(f"{of[name]:.2f}" for name in COLUMNS[3:])) for head, of in named]
    Console(width=160).print(markdown_table([name.replace("_", " ") for name in COLUMNS[2:]], cells))


if __name__ == "__main__":
    raise SystemExit(main())
