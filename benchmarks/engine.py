"""What each stage costs beside a plain version of the same work, in one run: `make bench`.

The plain versions (`benchmarks/plain`) are ordinary PyTorch in fp32; tests hold the same weights and draws to the same
losses, gradients and rewards. *fp32* is our own code without bf16. Inputs are random, all sides get the same, and they
are timed in turn, so that a busy machine slows all. Quote the ratios; absolute times belong to a machine. Markdown.

The floor is what the machine could not beat: the arithmetic of that side which needs less (matrix products and
convolutions, as PyTorch counts them; its fused LSTM is not counted) at the rate of a large matrix product, plus the
bytes that must move (pixels in, parameters and Adam's averages in and out) at the rate of a copy, both measured in the
same run.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from benchmarks.command import command
from benchmarks.plain.bootifol import PlainBootifol
from benchmarks.plain.drqv2 import PlainDrQv2, PlainReplay
from bootifol.agents.drqv2 import DrQv2
from bootifol.envs.pictures import RenderProfile
from bootifol.malloc import keep_freed_memory
from bootifol.presets import CPU, PAPER
from bootifol.progress import progress
from bootifol.replay.buffer import ReplayBuffer
from bootifol.reports.markdown import markdown_table
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.tasks import make_environment
from bootifol.training.config import TrainingConfig
from bootifol.types import Episode, FrameBatch, Video

FRAMES = 61
ACTION_DIM = 2
CONVOLUTIONS = {
    "paper": ((32, 3, 2), (32, 3, 1), (32, 3, 1), (32, 3, 1)),
    "strided": ((32, 3, 2), (32, 3, 2), (32, 3, 1), (32, 3, 1)),
    "coarse": ((32, 8, 4), (64, 4, 2), (64, 3, 1)),
}

HEADER = ("sizes", "stage", "ours ms", "fp32 ms", "plain ms", "plain / ours", "floor ms", "floor / ours")

STAGES = ["environment", "meta_world", "update", "alignment", "label"]

Work = Callable[[], object]


REPLAY_BYTES = 500_000_000
"""Of frames, in the timed replay: far more than any processor's cache, as in a run."""

BLOCK = 50
"""Environment steps that are timed at a stretch: a switch from one OpenGL context to another is no part of a step."""


class Stage(NamedTuple):
    """The same work several times."""

    ours: Work
    plain: Work
    fp32: Work | None
    """Ours without bf16; None where nothing is computed in it."""
    parameters: int | None
    """Trained by it (0: none); None where a floor of arithmetic and bytes says nothing: simulation, rendering."""
    pixels: int
    """Bytes of pictures that it reads."""
    block: int = 1
    """How often the work is done at a stretch."""


class Rates(NamedTuple):
    """What the machine can do, measured."""

    arithmetic: float
    """Operations a second of a bf16 matrix product."""
    copy: float
    """Bytes a second, read and written."""


class RandomVideos:
    """A source of random pixels, behind the protocol of demo sets."""

    def __init__(self, count: int, size: int, rng: np.random.Generator, frames: int = FRAMES) -> None:
        self.frames = rng.integers(0, 256, (count, frames, size, size, 3), dtype=np.uint8)

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> Video:
        return Video(str(index), self.frames[index])

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self.frames[rng.choice(len(self), count, replace=False)]


def environment_step(config: TrainingConfig, task: str) -> Stage:
    """An agent step: the preset's render profile beside the simulator's own quality."""

    def stepper(profile: RenderProfile) -> Work:
        environment = make_environment(task, replace(config.pictures, profile=profile), 10**9)
        environment.reset(seed=0)
        shape = environment.action_space.shape
        assert shape is not None
        actions = np.random.default_rng(0).uniform(-1, 1, (1000, *shape)).astype(np.float32)
        taken = itertools.cycle(actions)
        return lambda: environment.step(next(taken))

    return Stage(stepper(config.pictures.profile), stepper("full"), None, None, 0, BLOCK)


def agent_update(config: TrainingConfig) -> Stage:
    """Sampling a batch from replay and one DrQ-v2 update."""
    agent_config, pictures = config.agent, config.pictures
    size, stack, batch_size = pictures.agent_size, pictures.stack, agent_config.batch_size
    rng = np.random.default_rng(0)
    episodes = REPLAY_BYTES // (FRAMES * 3 * size**2)
    replay = ReplayBuffer(
        episodes * FRAMES, size, ACTION_DIM, stack, agent_config.n_step, agent_config.discount
    )
    plain_replay = PlainReplay(stack, agent_config.n_step, agent_config.discount)
    for index in range(episodes):
        frames = rng.integers(0, 256, (FRAMES, size, size, 3), dtype=np.uint8)
        actions = rng.uniform(-1, 1, (FRAMES - 1, ACTION_DIM)).astype(np.float32)
        episode = Episode(frames, actions, Video(str(index), frames), False)
        rewards = rng.normal(size=FRAMES - 1).astype(np.float32)
        replay.add(episode, rewards)
        plain_replay.add(episode, rewards)
    agent, in_fp32 = (
        DrQv2(replace(agent_config, precision=precision), size, stack, ACTION_DIM, 0)
        for precision in ("bf16", "fp32")
    )
    plain = PlainDrQv2(
        size,
        stack,
        ACTION_DIM,
        agent_config.feature_dim,
        agent_config.hidden_dim,
        CONVOLUTIONS[agent_config.encoder],
    )

    def plain_update() -> None:
        noise = 0.5 * torch.randn(2, batch_size, ACTION_DIM)
        shifts = torch.randint(-agent_config.random_shift, agent_config.random_shift + 1, (2, batch_size, 2))
        plain.update(
            plain_replay.sample(batch_size, rng), noise[0], noise[1], shifts, agent_config.random_shift
        )

    trained = count_parameters(agent.encoder, agent.actor, agent.critic)
    pixels = 2 * batch_size * 3 * stack * size**2
    return Stage(
        lambda: agent.update(replay.sample(batch_size, rng), 0),
        plain_update,
        lambda: in_fp32.update(replay.sample(batch_size, rng), 0),
        trained,
        pixels,
    )


def alignment_step(config: TrainingConfig, reward: BootifolConfig) -> Stage:
    """One gradient step of the reward on n expert and n other videos, every loss on every frame on both sides."""
    rng = np.random.default_rng(0)
    videos = RandomVideos(2 * reward.videos_per_class, config.pictures.video_size, rng)
    same_work = replace(reward, frames_per_video=None, sequence_times=1, motion=False)
    model, in_fp32 = in_both_precisions(same_work, config.pictures.video_size)
    plain = PlainBootifol(reward.width_divisor)
    n = reward.videos_per_class
    return Stage(
        lambda: model.update(videos, videos),
        lambda: plain.alignment_step(videos.sample(n, rng), videos.sample(n, rng)),
        lambda: in_fp32.update(videos, videos),
        count_parameters(model.networks),
        videos.frames.nbytes,
    )


def label_episode(config: TrainingConfig, reward: BootifolConfig, frames: int = FRAMES) -> Stage:
    """Rewarding an episode against one expert video whose encoding is not cached yet."""
    rng = np.random.default_rng(0)
    videos = RandomVideos(2, config.pictures.video_size, rng, frames)
    one_reference = replace(reward, references=1, motion=False)
    models = in_both_precisions(one_reference, config.pictures.video_size)
    plain = PlainBootifol(reward.width_divisor)
    names = iter(range(10**9))

    def label(model: BootifolRewardModel) -> None:
        model.label(videos[0], [Video(f"never seen {next(names)}", videos.frames[1])])

    return Stage(
        partial(label, models[0]),
        lambda: plain.label(videos.frames[0], videos.frames[1]),
        partial(label, models[1]),
        0,
        videos.frames.nbytes,
    )


def in_both_precisions(
    reward: BootifolConfig, video_size: int
) -> tuple[BootifolRewardModel, BootifolRewardModel]:
    """The reward model in bf16, and in fp32."""
    bf16, fp32 = (
        BootifolRewardModel(replace(reward, precision=precision), video_size, 0)
        for precision in ("bf16", "fp32")
    )
    return bf16, fp32


def count_parameters(*networks: nn.Module) -> int:
    return sum(parameter.numel() for network in networks for parameter in network.parameters())


def measured_rates() -> Rates:
    """Of a matrix product of 2048 x 2048 in bf16, and of copying a quarter of a gigabyte."""
    matrix = torch.randn(2048, 2048).bfloat16()
    source = torch.ones(2**28, dtype=torch.uint8)
    target = torch.empty_like(source)
    return Rates(
        2 * 2048**3 / quickest(lambda: matrix @ matrix),
        2 * source.nbytes / quickest(lambda: target.copy_(source)),
    )


def quickest(work: Work, runs: int = 7) -> float:
    """Seconds of the quickest run."""
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def floor(stage: Stage, rates: Rates) -> float | None:
    """Milliseconds that the stage's arithmetic and bytes take at the machine's rates."""
    if stage.parameters is None:
        return None
    # The fewer: ours also computes columns of film strips that nobody reads, plain gradients that nobody asked for.
    operations = min(operations_of(stage.ours), operations_of(stage.plain))
    # Read: parameter, gradient, both averages; written: parameter and averages; 4 bytes each.
    moved = stage.pixels + 7 * 4 * stage.parameters
    return 1e3 * (operations / rates.arithmetic + moved / rates.copy)


def operations_of(work: Work) -> int:
    """Multiplications and additions of convolutions and matrix products, as PyTorch counts them."""
    with FlopCounterMode(display=False) as counter:
        work()
    counted: int = counter.get_total_flops()
    return counted


def medians(works: Sequence[Work], runs: int, block: int) -> list[float]:
    """Median milliseconds of each, timed in turn in blocks, after a block of each that is not counted."""
    times: list[list[float]] = [[] for _ in works]
    for run in range(runs + 1):
        for work, kept in zip(works, times, strict=True):
            started = time.perf_counter()
            for _ in range(block):
                work()
            if run:
                kept.append(1e3 * (time.perf_counter() - started) / block)
    return [statistics.median(kept) for kept in times]


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--threads", type=int, default=1, help="that PyTorch computes with (1)")
    parser.add_argument(
        "--runs", type=int, default=3, help="timed runs of the slow stages; quick ones get more"
    )
    parser.add_argument("--sizes", nargs="+", choices=["paper", "cpu"], default=["paper", "cpu"])
    parser.add_argument("--stages", nargs="+", choices=STAGES, default=STAGES, help="what to time")
    arguments = parser.parse_args()
    keep_freed_memory()
    torch.set_num_threads(arguments.threads)
    rates = measured_rates()
    rows: list[list[str]] = []
    presets = {"paper": PAPER, "cpu": CPU}
    with progress("timing", total=len(arguments.stages) * len(arguments.sizes)) as advance:
        for name in arguments.sizes:
            config = presets[name]
            reward = config.reward.bootifol
            stages: dict[str, tuple[str, Callable[[], Stage], int]] = {
                "environment": (
                    "agent step of reacher_hard (plain: full quality)",
                    partial(environment_step, config, "reacher_hard"),
                    5,
                ),
                "meta_world": (
                    "agent step of button_press (plain: full quality)",
                    partial(environment_step, config, "button_press"),
                    3,
                ),
                "update": ("sample and RL update", partial(agent_update, config), arguments.runs + 2),
                "alignment": ("alignment step", partial(alignment_step, config, reward), arguments.runs),
                "label": (
                    "label an episode of 61 frames against one reference that is not cached",
                    partial(label_episode, config, reward),
                    arguments.runs + 2,
                ),
            }
            for key in arguments.stages:
                title, make, runs = stages[key]
                work = make()
                least = floor(work, rates)
                sides = [work.ours, work.plain, *([work.fp32] if work.fp32 else [])]
                ours, plain, *fp32 = medians(sides, runs, work.block)
                rows.append(
                    [
                        name,
                        title,
                        f"{ours:.1f}",
                        "".join(f"{each:.1f}" for each in fp32),
                        f"{plain:.1f}",
                        f"{plain / ours:.1f}",
                        "" if least is None else f"{least:.1f}",
                        "" if least is None else f"{least / ours:.0%}",
                    ]
                )
                advance(1)
    print(
        f"{arguments.threads} thread(s), {rates.arithmetic / 1e9:.0f} GFLOP/s in bf16, copies of "
        f"{rates.copy / 1e9:.1f} GB/s\n"
    )
    print(markdown_table(HEADER, rows))


if __name__ == "__main__":
    raise SystemExit(main())
