"""How fast frozen backbones are on this machine, and what bfloat16 costs in accuracy.

    python -m benchmarks.backbone efficientnet_lite0 google/efficientnet-b0

Random frames, one thread. Seconds are those of the CPU, so that other work on the machine counts for little.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from benchmarks.command import command
from bootifol.networks.backbones import Backbone, load_backbone
from bootifol.types import Frames


def frames_per_second(backbone: Backbone, frames: Frames, runs: int) -> float:
    """The fastest of some runs, in frames a second of the CPU."""
    seconds = []
    for _ in range(runs):
        began = time.process_time()
        backbone.features(frames)
        seconds.append(time.process_time() - began)
    return len(frames) / min(seconds)


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("backbones", nargs="+", metavar="BACKBONE", help="names or directories")
    parser.add_argument("--size", type=int, default=224, help="height and width of the frames")
    parser.add_argument("--frames", type=int, default=32)
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    size = arguments.size
    frames = np.random.default_rng(0).integers(0, 256, (arguments.frames, size, size, 3), dtype=np.uint8)
    table = Table("backbone", "features", "fp32, frames/s", "bf16, frames/s", "error of bf16")
    for name in arguments.backbones:
        exact, rounded = load_backbone(name, size, "fp32"), load_backbone(name, size, "bf16")
        features = exact.features(frames)
        error = np.linalg.norm(rounded.features(frames) - features) / np.linalg.norm(features)
        speeds = [frames_per_second(backbone, frames, arguments.runs) for backbone in (exact, rounded)]
        table.add_row(name, str(exact.feature_size), *(f"{speed:.0f}" for speed in speeds), f"{error:.1%}")
    Console().print(table)


if __name__ == "__main__":
    raise SystemExit(main())
