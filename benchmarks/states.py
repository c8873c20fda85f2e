"""What an agent on states costs, stage by stage, with the sizes of the preset `frames`; the last part of `make bench`.

    python -m benchmarks.states

Inputs are random. The floor is the arithmetic of matrix products and convolutions at the rate of a large one in the
preset's precision, fp32, and the bytes that must move at the rate of a copy, both measured in the same run. `long` has
the update of the pictures' agent beside it, timed in turn. Markdown.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from functools import partial

import numpy as np
import torch

from benchmarks.command import command
from benchmarks.engine import (
    ACTION_DIM,
    FRAMES,
    RandomVideos,
    Rates,
    Stage,
    Work,
    agent_update,
    count_parameters,
    floor,
    measured_rates,
    medians,
    quickest,
)
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.encodings import StackedStates
from bootifol.malloc import keep_freed_memory
from bootifol.presets import LONG, preset
from bootifol.replay.agent_videos import AgentVideos
from bootifol.replay.buffer import ReplayBuffer
from bootifol.reports.markdown import markdown_table
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.types import Episode, Frames, Video

EPISODES = 500
RENEWED = 100_000
"""Frames of a replay that get new states."""

HEADER = ("stage", "ms", "floor ms", "floor / ms", "of the preset long ms")


def stages() -> dict[str, tuple[Stage, float]]:
    """Each with how many times its work is what is asked for."""
    config = preset("frames")
    agent_config, pictures, frames = config.agent, config.pictures, config.reward.bootifol.frames
    rng = np.random.default_rng(0)
    model = FrameRewardModel(frames, pictures.video_size, 0)
    states = StackedStates(model.eyes, pictures.stack)
    agent = DrQv2(agent_config, pictures.agent_size, pictures.stack, ACTION_DIM, 0, encodings=states)
    size = model.feature_size
    replay = ReplayBuffer(
        EPISODES * FRAMES,
        pictures.agent_size,
        ACTION_DIM,
        pictures.stack,
        agent_config.n_step,
        feature_size=size,
    )
    of_agent = AgentVideos(EPISODES, FRAMES, pictures.video_size, size, 1)
    for index in range(EPISODES):
        seen = rng.integers(-100, 101, (FRAMES, size)).astype(np.int8)
        video = Video(str(index), np.empty((FRAMES, 0, 0, 3), np.uint8), features=seen)
        actions = rng.uniform(-1, 1, (FRAMES - 1, ACTION_DIM)).astype(np.float32)
        replay.add(
            Episode(video.frames, actions, video, False), rng.normal(size=FRAMES - 1).astype(np.float32)
        )
        of_agent.add(video)
    expert = RandomVideos(32, pictures.video_size, rng)
    next(model.align(expert, expert))
    some = expert.frames.reshape(-1, *expert.frames.shape[2:])[:512]
    batch = agent_config.batch_size
    update: Work = lambda: agent.update(replay.sample(batch, rng), 0)  # noqa: E731
    head: Work = lambda: model.update(expert, of_agent)  # noqa: E731
    label: Work = lambda: model.score(seen)  # noqa: E731
    trained = count_parameters(agent.actor, agent.critic)
    return {
        f"sample and RL update of {batch}": (
            Stage(update, update, None, trained, 2 * batch * pictures.stack * size),
            1,
        ),
        "gradient step of the reward's head": (
            Stage(head, head, None, count_parameters(model.networks.head), 0),
            1,
        ),
        "states of one frame": (Stage(*see(model, some[:1]), None, 0, some[0].nbytes), 1),
        "rewards of an episode of 61 frames": (Stage(label, label, None, 0, seen.nbytes), 1),
        f"renewing the states of {RENEWED:,} frames": (
            Stage(*see(model, some), None, 0, some.nbytes),
            RENEWED / len(some),
        ),
    }


def see(model: FrameRewardModel, frames: Frames) -> tuple[Work, Work]:
    """The eyes on frames."""
    work = partial(model.states, frames)
    return work, work


def fp32_rates() -> Rates:
    """Of a matrix product of 2048 x 2048 in fp32, and of a copy."""
    matrix = torch.randn(2048, 2048)
    return measured_rates()._replace(arithmetic=2 * 2048**3 / quickest(lambda: matrix @ matrix))


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=30, help="timed runs of a stage")
    arguments = parser.parse_args()
    keep_freed_memory()
    torch.set_num_threads(1)
    rates = fp32_rates()
    of_long = agent_update(LONG)
    rows = []
    for title, (stage, times) in stages().items():
        least = floor(stage, rates) or 0.0
        beside: list[Callable[[], object]] = [stage.ours]
        if "RL update" in title:
            beside.append(of_long.ours)
        runs = arguments.runs if times == 1 else 3
        ours, *long = (each * times for each in medians(beside, runs, 1))
        shown = f"{long[0]:.1f} (of {LONG.agent.batch_size})" if long else ""
        rows.append((title, f"{ours:.1f}", f"{least * times:.2f}", f"{least * times / ours:.0%}", shown))
    print(f"1 thread, {rates.arithmetic / 1e9:.0f} GFLOP/s in fp32, copies of {rates.copy / 1e9:.1f} GB/s\n")
    print(markdown_table(HEADER, rows))
    help_words = [sys.executable, "-m", "bootifol", "--help"]
    seconds = quickest(lambda: subprocess.run(help_words, capture_output=True, check=True), 3)
    print(f"\n`bootifol --help`: {seconds:.2f} s")


if __name__ == "__main__":
    raise SystemExit(main())
