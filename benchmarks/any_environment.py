"""Environments that are not ours, end to end: an expert is filmed to mp4 files, and only those files are learned from.

    python -m benchmarks.any_environment pendulum --out runs/pendulum --time-budget 40m
    python -m benchmarks.any_environment reacher --out runs/reacher_v5 --time-budget 40m

Pendulum-v1 needs no MuJoCo, Reacher-v5 does; both need `pip install 'bootifol[gymnasium]'`. Functions below make them,
so that their pictures show what they must and not what they should not. The experts below read the simulator's state.
They are filmed by Gymnasium's renderer at its full size and speed, as any user would film theirs; from there on this
script only types the commands that a user would type, and prints them. What is there already is not done again.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from benchmarks.command import command
from bootifol.cli.main import main as bootifol
from bootifol.envs.any_gymnasium import GymnasiumSimulator
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import STOPPED
from bootifol.progress import progress
from bootifol.video_files.writing import write_video

Controller = Callable[[Any], NDArray[np.float64]]
"""The expert's action, in the environment's own units, from the environment itself."""


@dataclass(frozen=True)
class Example:
    """An environment and how to learn it."""

    task: str
    """As commands name it."""
    expert: Controller
    action_repeat: int
    episode_steps: int
    """Agent steps of a training episode."""
    pushes: float = 0.0
    """Chance, at each agent step, that a random action takes over for one to three of them. An expert that never errs
    never shows how to recover, and its clone, which does err, is lost (DART: Laskey et al., 2017)."""


def swing_up(environment: Any) -> NDArray[np.float64]:
    """Pendulum: pumps energy until the pole is nearly up, then holds it there with a spring and a damper.

    It pushes the less, the less energy is missing. A push of full strength to either side would return as much and
    change sides within an agent step, which no agent that acts once in that time could imitate.
    """
    angle, velocity = environment.state  # 0 is upright
    angle = (angle + np.pi) % (2 * np.pi) - np.pi
    gravity, mass, length = environment.g, environment.m, environment.l
    energy = mass * length**2 * velocity**2 / 6 + mass * gravity * length * (np.cos(angle) - 1) / 2
    near = abs(angle) < 0.5 and abs(velocity) < 4.0
    # The energy is 0 when the pole stands still on top.
    torque = -12.0 * angle - 3.0 * velocity if near else -0.5 * energy * velocity
    return np.array([np.clip(torque, -environment.max_torque, environment.max_torque)])


def reach(environment: Any) -> NDArray[np.float64]:
    """Reacher: both joints are pulled, as by damped springs, to the nearer of the two poses that reach the target.

    In the units of `reacher_from_above`, whose strongest torque is 1.
    """
    upper, fore = 0.1, 0.11  # lengths of the links in meters
    angles, velocities = environment.data.qpos[:2], environment.data.qvel[:2]
    x, y = environment.get_body_com("target")[:2]
    cosine = (x**2 + y**2 - upper**2 - fore**2) / (2 * upper * fore)
    bend = np.arccos(np.clip(cosine, -1.0, 1.0))
    errors = []
    for elbow in (bend, -bend):
        shoulder = np.arctan2(y, x) - np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow))
        turn = (shoulder - angles[0] + np.pi) % (2 * np.pi) - np.pi
        errors.append(np.array([turn, elbow - angles[1]]))
    error = min(errors, key=lambda candidate: float(np.abs(candidate).sum()))
    torque: NDArray[np.float64] = np.clip((0.5 * error - 0.08 * velocities) / STRONGEST, -1.0, 1.0)
    return torque


class _WithoutArrow(gymnasium.Wrapper[Any, Any, Any, Any]):
    def render(self) -> Any:
        environment: Any = self.unwrapped
        environment.last_u = None  # what it draws the arrow for
        return self.env.render()


def pendulum_without_arrow() -> gymnasium.Env[Any, Any]:
    """Pendulum-v1 without the arrow of its last torque: a video of the real thing would not show its actions."""
    return _WithoutArrow(gymnasium.make("Pendulum-v1", render_mode="rgb_array"))


STRONGEST = 0.2
"""Of Reacher-v5's torques, of 1. With all of it random actions whirl the arm about, and what they teach is far coarser
than the expert's actions, which are below 0.3 in 19 steps of 20."""


def reacher_from_above() -> gymnasium.Env[Any, Any]:
    """Reacher-v5 with gentler torques, and a camera that fills the picture with what matters.

    Its own camera shows the target as one pixel of 64², and nothing of what a torque does to the arm in one step.
    """
    camera = {
        "distance": 0.75,
        "azimuth": 90.0,
        "elevation": -90.0,
        "lookat": np.zeros(3),
        "trackbodyid": -1,
    }
    environment = gymnasium.make("Reacher-v5", render_mode="rgb_array", default_camera_config=camera)
    unit = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    return gymnasium.wrappers.TransformAction(environment, lambda action: STRONGEST * action, unit)


EXAMPLES = {
    "pendulum": Example(
        "benchmarks.any_environment:pendulum_without_arrow",
        swing_up,
        action_repeat=2,
        episode_steps=60,
        pushes=0.15,
    ),
    "reacher": Example(
        "benchmarks.any_environment:reacher_from_above", reach, action_repeat=2, episode_steps=40
    ),
}


def pushed(
    example: Example, environment: gymnasium.Env[Any, Any], rng: np.random.Generator
) -> Iterator[NDArray[np.float64]]:
    """The expert's actions, one a step of the environment, and random ones in their place where it is pushed."""
    space = environment.action_space
    assert isinstance(space, gymnasium.spaces.Box)
    left = 0
    push = np.zeros(space.shape)
    while True:
        if left == 0 and rng.random() < example.pushes:
            left, push = int(rng.integers(1, 4)), rng.uniform(space.low, space.high)
        for _ in range(example.action_repeat):
            yield push if left else example.expert(environment.unwrapped)
        left = max(left - 1, 0)


def film(example: Example, directory: Path, episodes: int) -> float:
    """Writes one mp4 an episode of the expert, with every frame; those that are there are kept.

    Returns:
        Frames per second.
    """
    simulator = GymnasiumSimulator(example.task, PictureConfig())
    environment: gymnasium.Env[Any, Any] = simulator.environment
    returns = []
    with progress(f"filming the expert of {example.task}", episodes) as advance:
        for number in range(episodes):
            path = directory / f"{number:04d}.mp4"
            if not path.exists():
                simulator.reset(seed=10_000 + number)
                frames, total = [np.asarray(environment.render())], 0.0
                actions = pushed(example, environment, np.random.default_rng(number))
                for _ in range(example.action_repeat * example.episode_steps + 1):
                    _, reward, *_ = environment.step(next(actions).astype(np.float32))
                    total += float(reward)
                    frames.append(np.asarray(environment.render()))
                write_video(path, np.stack(frames), 1.0 / simulator.step_seconds)
                returns.append(total)
            advance()
    simulator.close()
    if returns:
        print(
            f"the expert returns {np.mean(returns):.1f} ± {np.std(returns):.1f} in {len(returns)} filmed episodes"
        )
    return 1.0 / simulator.step_seconds


def typed(*words: str) -> None:
    """Types one command of bootifol.

    Raises:
        KeyboardInterrupt: it was stopped.
        SystemExit: it failed, and has said why.
    """
    print(f"$ bootifol {shlex.join(words)}", flush=True)
    code = bootifol(words)
    if code == STOPPED:
        raise KeyboardInterrupt
    if code:
        raise SystemExit(code)


@command(resumes=True)
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("environment", choices=EXAMPLES)
    parser.add_argument("--out", type=Path, required=True, help="directory for videos, demos and the run")
    parser.add_argument("--episodes", type=int, default=200, help="expert episodes to film")
    parser.add_argument("--preset", default="cpu")
    parser.add_argument("--time-budget", default="40m")
    parser.add_argument("--threads", default="1")
    arguments = parser.parse_args()
    example, out = EXAMPLES[arguments.environment], arguments.out
    videos, demos, run = out / "videos", out / "demos", out / "run"
    lengths = ["--action-repeat", str(example.action_repeat), "--episode-steps", str(example.episode_steps)]
    rate = film(example, videos, arguments.episodes) / example.action_repeat
    if not demos.exists():
        shape = ["--fps", f"{rate:g}", "--frames", str(example.episode_steps + 1)]
        typed("demos", "import", str(videos), "--out", str(demos), *shape, "--windows", "first")
    typed("demos", "check", str(demos), "--task", example.task, *lengths)
    if (run / "config.json").exists():
        typed("train", "--resume", str(run), "--trust")
    else:
        typed(
            *("train", "--task", example.task, *lengths, "--demos", str(demos), "--out", str(run)),
            *("--preset", arguments.preset, "--time-budget", arguments.time_budget),
            *("--threads", arguments.threads),
        )
    typed("evaluate", str(run), "--episodes", "10", "--trust")
    typed("tasks", example.task, "--measure", "10")


if __name__ == "__main__":
    raise SystemExit(main())
