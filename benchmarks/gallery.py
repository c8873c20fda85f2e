"""One picture for the docs: expert and random film strips of every task.

    python -m benchmarks.gallery --out docs/images/gallery.png

One episode of the training length each, from the same start. A task without a bundled expert
shows random actions alone. Profile full: Meta-World takes most of the few minutes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.command import command
from bootifol.demos.record import Recording, play
from bootifol.envs.pictures import PictureConfig
from bootifol.experts import Behavior
from bootifol.files import written_aside
from bootifol.progress import progress
from bootifol.tasks import TASKS, Task
from bootifol.types import Frames

PICTURES = 8
"""Pictures of a strip, evenly spaced from the first frame to the last."""

SIZE = 96
"""Height and width of a picture in pixels."""


def strip(task: Task, behavior: Behavior, seed: int) -> Frames:
    """Pictures of one episode, uint8 `[PICTURES, SIZE, SIZE, 3]`."""
    pictures = PictureConfig(agent_size=SIZE, video_size=SIZE, profile="full")
    plan = Recording(task.name, behavior, 1, pictures, seed, task.episode_steps, task.action_repeat)
    frames = play(plan, 0)
    evenly: Frames = frames[np.linspace(0, len(frames) - 1, PICTURES).round().astype(int)]
    return evenly


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("docs/images/gallery.png"))
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    performances: list[tuple[Task, Behavior]] = [
        (task, behavior)
        for task in TASKS.values()
        for behavior in (("expert", "random") if task.has_expert else ("random",))
    ]
    figure = Figure(figsize=(10.4, 1.08 * len(performances)), dpi=120)
    with progress("playing", total=len(performances)) as advance:
        for row, (task, behavior) in enumerate(performances):
            frames = strip(task, behavior, arguments.seed)
            height = 1 / len(performances)
            axes = figure.add_axes((0.17, 1 - (row + 0.96) * height, 0.825, 0.92 * height))
            axes.imshow(
                np.concatenate([np.pad(f, ((0, 0), (0, 3), (0, 0)), constant_values=255) for f in frames], 1)
            )
            axes.set_axis_off()
            first = row == 0 or performances[row - 1][0] is not task
            if first:
                axes.text(
                    -0.01, 0.62, task.name, transform=axes.transAxes, ha="right", weight="bold", fontsize=9
                )
            axes.text(
                -0.01, 0.38, behavior, transform=axes.transAxes, ha="right", fontsize=9, color="#555555"
            )
            advance()
    with written_aside(arguments.out) as aside:
        figure.savefig(aside, format="png", facecolor="white")
        # 256 colors look the same here, in a third of the bytes.
        Image.open(aside).convert("RGB").quantize(256).save(aside, format="png", optimize=True)
    print(arguments.out)


if __name__ == "__main__":
    raise SystemExit(main())
