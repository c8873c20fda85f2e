"""How large is a policy as an ONNX file, and how long does an action take? One thread; untrained networks, which are as
large and as quick as trained ones.

    python -m benchmarks.onnx_policies

The table has the file's size, the milliseconds an action takes in onnxruntime and with `Policy.act` (the middle of
`--actions`, one picture each), and the largest difference between the two on these pictures. Eyes round what they see:
where a state lies halfway, the last bit decides, and the actions differ by that.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.command import command
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.encodings import StackedStates
from bootifol.agents.policy import PolicyConfig, read_networks, read_policy, write_policy
from bootifol.agents.policy_onnx import ACTION, PICTURES, write_onnx
from bootifol.envs.pictures import FrameStack
from bootifol.networks.eyes import Eyes
from bootifol.presets import preset
from bootifol.reports.markdown import markdown_table
from bootifol.types import Action, Frame

ACTION_DIM = 6
"""Numbers in an action, as a small arm has them."""

WARM_UP = 20
"""Actions before any is timed."""


def write_untrained(path: Path, name: str) -> None:
    """The policy of a preset before it learns, as a run writes it."""
    training = preset(name)
    size, stack = training.pictures.agent_size, training.pictures.stack
    torch.manual_seed(0)
    states = None
    if training.agent.observations == "states":
        eyes = Eyes(size, training.reward.bootifol.frames.width)
        eyes.normalization.momentum = 1.0
        with torch.no_grad():  # states of unit variance, as those of trained eyes are
            eyes.train()(torch.randint(0, 256, (32, size, size, 3), dtype=torch.uint8))
        states = StackedStates(eyes, stack)
    agent = DrQv2(training.agent, size, stack, ACTION_DIM, seed=0, encodings=states)
    write_policy(path, PolicyConfig(name, 0, ACTION_DIM, 1, 25.0, training.pictures), agent)


def timed(act: Callable[[Frame], Action], frames: Sequence[Frame]) -> tuple[float, NDArray[np.float32]]:
    """Milliseconds that an action takes, in the middle of all, and the actions `[N, A]`."""
    milliseconds, actions = [], []
    for frame in frames:
        began = time.perf_counter()
        actions.append(act(frame))
        milliseconds.append(1000 * (time.perf_counter() - began))
    return float(np.median(milliseconds[WARM_UP:])), np.stack(actions)


def measured(name: str, actions: int) -> list[str]:
    """A preset's line of the table."""
    import onnxruntime

    with TemporaryDirectory() as folder:
        policy_file, onnx_file = Path(folder) / "policy.safetensors", Path(folder) / "policy.onnx"
        write_untrained(policy_file, name)
        write_onnx(onnx_file, read_networks(policy_file))
        policy = read_policy(policy_file)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        session = onnxruntime.InferenceSession(onnx_file, options, providers=["CPUExecutionProvider"])
        size, stack = policy.config.pictures.agent_size, FrameStack(policy.config.pictures.stack)

        def act(frame: Frame) -> Action:
            action: Action = session.run([ACTION], {PICTURES: stack.add(frame)[None]})[0][0]
            return action

        rng = np.random.default_rng(0)
        frames = [rng.integers(0, 256, (size, size, 3), np.uint8) for _ in range(WARM_UP + actions)]
        here, expected = timed(policy.act, frames)
        there, found = timed(act, frames)
        seen = "states" if isinstance(read_networks(policy_file).see, Eyes) else "pictures"
        return [
            f"`{name}`",
            f"{policy.config.pictures.stack} × {size}×{size}, {seen}",
            f"{onnx_file.stat().st_size / 1e6:.2f}",
            f"{there:.2f}",
            f"{here:.2f}",
            f"{np.abs(found - expected).max():.1g}",
        ]


@command()
def main(words: Sequence[str] | None = None) -> None:
    """Measures the policies of presets."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--presets", nargs="+", default=["drawn", "frames", "cpu", "paper"])
    parser.add_argument("--actions", type=int, default=300)
    asked = parser.parse_args(words)
    torch.set_num_threads(1)
    header = ("Preset", "Sees", "MB", "ms, onnxruntime", "ms, `Policy.act`", "Largest difference")
    rule = ("---", "---", "---:", "---:", "---:", "---:")
    print(markdown_table(header, [measured(name, asked.actions) for name in asked.presets], rule))


if __name__ == "__main__":
    raise SystemExit(main())
