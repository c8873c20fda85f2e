"""What do the eyes tell of the true state? A small network reads it from the states of single frames (diagnosis only).

    python -m benchmarks.probe reacher_hard --demos demos/reacher_hard --steps 900

The eyes learn from the videos, as in a run. Then the expert and all who fail plausibly play in turn, the network learns
each number of the simulator's own observation (Meta-World: where hand, object and goal are) from what the eyes make of
the frame, and the table says how well it does on held-out episodes: R² (1 is exact, 0 knows nothing) and the median
absolute error in the simulator's units. Speeds, and angles that turn without end, cannot be told from one frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rich.console import Console
from torch import nn

from benchmarks.command import command
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import find_demo_sets, read_manifest
from bootifol.envs.dm_control import DMControlSimulator
from bootifol.envs.meta_world import MetaWorldSimulator
from bootifol.envs.pictures import PictureConfig
from bootifol.envs.rollout import rollout
from bootifol.errors import BootifolError
from bootifol.experts import make_expert
from bootifol.experts.failures import failures_of, make_failure
from bootifol.networks.eyes import as_features
from bootifol.presets import preset
from bootifol.progress import progress
from bootifol.reports.markdown import markdown_table
from bootifol.rewards.bootifol.frames.config import FrameConfig
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.tasks import make_environment, task_named
from bootifol.types import Frames

KEPT = 0.25
"""Fraction of the frames that are kept: neighbors look alike."""

PLACES = {"hand": slice(0, 3), "object": slice(4, 7), "goal": slice(36, 39)}
"""Where they stand in Meta-World's observation, in meters."""


def observed(simulator: Any) -> dict[str, float]:
    """What the simulator's own observation says, number by number.

    Raises:
        BootifolError: the simulator has none that the probe can read.
    """
    if isinstance(simulator, DMControlSimulator):
        named = dict(simulator.environment.task.get_observation(simulator.physics))
    elif isinstance(simulator, MetaWorldSimulator):
        named = {name: simulator.observation[where] for name, where in PLACES.items()}
    else:
        raise BootifolError("the probe reads tasks of DeepMind Control and Meta-World alone")
    return {f"{name}[{i}]": float(x) for name, value in named.items() for i, x in enumerate(np.ravel(value))}


def watched(task: str, count: int, pictures: PictureConfig) -> tuple[Frames, NDArray[np.float32], list[str]]:
    """Frames `[N, S, S, 3]` of the expert and of those who fail, the simulator's observations `[N, O]`, and the names
    of these."""
    environment = make_environment(task, pictures, task_named(task).episode_steps)
    performers = ["expert", *failures_of(task, environment)]
    rng = np.random.default_rng(0)
    frames: list[Frames] = []
    truths: list[dict[str, float]] = []
    with progress("the expert and failures", count) as advance:
        episode = 0
        while len(frames) < count:
            kind, seed = performers[episode % len(performers)], 10**7 + episode
            failing = kind != "expert"
            act = make_failure(kind, task, environment, seed) if failing else make_expert(task, environment)
            for step in rollout(environment, act, seed):
                if rng.random() < KEPT and len(frames) < count:
                    truths.append(observed(environment.simulator))
                    frames.append(step.video_frame)
                    advance(1)
            episode += 1
    values = [list(truth.values()) for truth in truths]
    return np.stack(frames), np.array(values, np.float32), list(truths[0])


def read(
    states: torch.Tensor, truth: torch.Tensor, epochs: int = 30
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """R² and median absolute error of each number of `truth` on the last quarter, learned from the first three."""
    torch.manual_seed(0)
    learned = len(states) * 3 // 4
    mean, spread = truth[:learned].mean(0), truth[:learned].std(0) + 1e-6
    wanted = (truth - mean) / spread
    inputs, outputs, width = states.shape[1], truth.shape[1], 256
    network = nn.Sequential(
        nn.Linear(inputs, width),
        nn.LayerNorm(width),
        nn.ReLU(),
        nn.Linear(width, width),
        nn.ReLU(),
        nn.Linear(width, outputs),
    )
    optimizer = torch.optim.AdamW(network.parameters(), weight_decay=0.01)
    steps = epochs * learned // 128
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 1e-3, total_steps=steps)
    for _ in range(steps):
        rows = torch.randint(learned, (128,))
        loss = nn.functional.mse_loss(network(states[rows]), wanted[rows])
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        schedule.step()
    with torch.no_grad():
        error = network(states[learned:]) - wanted[learned:]
    r2 = 1 - error.square().mean(0) / wanted[learned:].var(0)
    return r2.numpy(), (error.abs() * spread).median(0).values.numpy()


def with_fields(config: FrameConfig, fields: Sequence[str]) -> FrameConfig:
    """The configuration with other numbers, each given as NAME=NUMBER."""
    for field in fields:
        name, _, number = field.partition("=")
        before = getattr(config, name, None)
        if not isinstance(before, int | float):
            raise BootifolError(f"--field {field}: the eyes have no number of that name; write NAME=NUMBER")
        try:
            changes: dict[str, Any] = {name: type(before)(number)}
            config = replace(config, **changes)
        except ValueError as error:
            raise BootifolError(f"--field {field}: {number!r} is no number for {name}") from error
    return config


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("task", help="from the catalogue, of DeepMind Control")
    parser.add_argument("--demos", type=Path, required=True, help="directory of its demo sets")
    parser.add_argument("--steps", type=int, default=2000, help="of the Alignment Phase")
    parser.add_argument("--frames", type=int, default=8000, help="that the probe learns and is judged on")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--field",
        action="append",
        default=[],
        help="of the eyes, NAME=NUMBER, such as width=32; may be repeated",
    )
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    config = preset("frames")
    frames_config = with_fields(config.reward.bootifol.frames, arguments.field)
    paths = find_demo_sets(arguments.demos)
    pictures = replace(config.pictures, video_size=read_manifest(paths["expert"]).video_size)
    model = FrameRewardModel(frames_config, pictures.video_size, arguments.seed)
    expert, random = (DemoSet.open(paths[kind], verify=False) for kind in ("expert", "random"))
    with progress("aligning", arguments.steps) as advance:
        for _ in islice(model.align(expert, random), arguments.steps):
            advance(1)
    frames, truth, names = watched(arguments.task, arguments.frames, pictures)
    r2, error = read(as_features(torch.from_numpy(model.states(frames))), torch.from_numpy(truth))
    rows = [
        (name, f"{a:.3f}", f"{b:.4f}", f"{c:.4f}")
        for name, a, b, c in zip(names, r2, error, truth.std(0), strict=True)
    ]
    Console().print(markdown_table(("observation", "R²", "median error", "spread"), rows))


if __name__ == "__main__":
    raise SystemExit(main())
