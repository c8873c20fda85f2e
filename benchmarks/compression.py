"""Does the reward read what videos show, or that they were compressed?

    python -m benchmarks.compression --out results/own_videos/compression.csv

One's own expert videos come from files, and the random and the agent's videos straight from the environment. Here the
expert videos of a task are written to mp4 and imported again, and the reward is aligned on them and on random videos as
they were recorded: once as they are, once with augmentation. It then rewards held-out expert, half-good and random
videos, each as recorded and through mp4. A reward of the task gives a video the same twice; one of compression puts any
mp4 above anything else. Each row of OUT.csv is a video; the tables that are printed show mean rewards, and

- AUC: how often a better video is rewarded above a worse one, both as recorded (0.5: a coin);
- crossed: how often a recorded expert video is above a random one through mp4 (0: only compression is read);
- shift: how much mp4 adds to the reward of the same video, as a fraction of what tells expert from random.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.command import command
from benchmarks.rows import Row, write_rows
from benchmarks.task_rankings import Setup, aligned, recorded
from bootifol.demos.augmentation import augmented
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.export_videos import export_videos
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.demos.record import HALF_GOOD_VIDEOS
from bootifol.errors import require_at_least
from bootifol.evaluation.ranking import KINDS, area_under_curve
from bootifol.malloc import keep_freed_memory
from bootifol.reports.markdown import markdown_table
from bootifol.rewards.base import RewardModel
from bootifol.rewards.references import draw_references
from bootifol.tasks import TASKS
from bootifol.types import Video, VideoSource

COLUMNS = (
    "task",
    "preset",
    "gradient_steps",
    "videos",
    "seed",
    "augmentation",
    "kind",
    "pictures",
    "video",
    "reward",
)
PICTURES = ("recorded", "mp4")


def through_mp4(demos: Path, kind: str) -> DemoSet:
    """The videos of a demo set after mp4 files and `demos import`; made once, in `mp4/` beside the sets."""
    directory = demos / "mp4" / kind
    if not directory.exists():
        recorded_set = DemoSet.open(demos / kind)
        files = demos / "mp4" / f"{kind}_files"
        if not files.exists():
            export_videos(demos, files, behavior=kind)
        manifest = recorded_set.manifest
        import_videos(
            sorted(files.iterdir()),
            directory,
            Conversion(manifest.frames, manifest.video_size),
            behavior=kind,
        )
    return DemoSet.open(directory)


def rewards_of(model: RewardModel, videos: Sequence[Video], expert: VideoSource, seed: int) -> list[float]:
    """The summed reward of each video, against expert videos drawn alike for every call."""
    rng = np.random.default_rng(seed)
    return [float(model.label(video, draw_references(model, expert, rng)).sum()) for video in videos]


def measure(setup: Setup, task_name: str, demos: Path, workers: int) -> list[Row]:
    """A row a held-out video, way of its pictures, and augmentation."""
    task, place = TASKS[task_name], demos / task_name
    training, held_out = recorded(task, setup, demos, workers)
    expert = through_mp4(place / "training", "expert")
    shown = {
        kind: {
            "recorded": held_out[kind],
            "mp4": [
                replace(video, name=f"held-out-mp4-{video.name}")
                for video in map(files.__getitem__, range(len(files)))
            ],
        }
        for kind, files in ((kind, through_mp4(place / "held_out", kind)) for kind in KINDS)
    }
    rows: list[Row] = []
    for name, varied in (("never", False), ("always", True)):
        model = aligned(task, setup, augmented(expert, varied), augmented(training["random"], varied))
        about = {
            "task": task_name,
            "preset": setup.preset,
            "gradient_steps": str(setup.gradient_steps),
            "videos": str(setup.training_videos),
            "seed": str(setup.seed),
            "augmentation": name,
        }
        for kind in KINDS:
            for pictures in PICTURES:
                videos = shown[kind][pictures]
                rows += [
                    {
                        **about,
                        "kind": kind,
                        "pictures": pictures,
                        "video": video.name,
                        "reward": f"{reward:.6g}",
                    }
                    for video, reward in zip(
                        videos, rewards_of(model, videos, expert, setup.seed), strict=True
                    )
                ]
    return rows


def report(rows: Sequence[Row]) -> str:
    """Both tables in Markdown."""
    names = list(dict.fromkeys(row["augmentation"] for row in rows))
    rewards = {
        (name, kind, pictures): np.array(
            [
                float(row["reward"])
                for row in rows
                if (row["augmentation"], row["kind"], row["pictures"]) == (name, kind, pictures)
            ]
        )
        for name in names
        for kind in KINDS
        for pictures in PICTURES
    }
    means = markdown_table(
        ["augmentation", *(f"{kind}, {pictures}" for kind in KINDS for pictures in PICTURES)],
        [
            [
                name,
                *(f"{rewards[name, kind, pictures].mean():.1f}" for kind in KINDS for pictures in PICTURES),
            ]
            for name in names
        ],
    )
    areas = markdown_table(
        ["augmentation", "expert > half-good", "half-good > random", "crossed", "shift"],
        [[name, *(f"{value:.2f}" for value in summarized(rewards, name))] for name in names],
    )
    return f"{means}\n\n{areas}"


def summarized(
    rewards: dict[tuple[str, str, str], NDArray[np.float64]], name: str
) -> tuple[float, float, float, float]:
    """AUC of expert above half-good and of half-good above random, the crossed one, and the shift."""
    expert, half_good, random = (
        rewards[name, kind, "recorded"] for kind in ("expert", "half_good", "random")
    )
    shift = np.mean(
        [rewards[name, kind, "mp4"].mean() - rewards[name, kind, "recorded"].mean() for kind in KINDS]
    )
    return (
        area_under_curve(expert, half_good),
        area_under_curve(half_good, random),
        area_under_curve(expert, rewards[name, "random", "mp4"]),
        float(shift / (expert.mean() - random.mean())),
    )


@command()
def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--task", default="reacher_hard", choices=[name for name in TASKS if TASKS[name].has_expert]
    )
    parser.add_argument("--preset", default="cpu", help="whose pictures and reward model")
    parser.add_argument("--gradient-steps", type=int, default=120, help="of each alignment")
    parser.add_argument("--videos", type=int, default=120, help="expert and random videos each to learn from")
    parser.add_argument(
        "--held-out", type=int, default=HALF_GOOD_VIDEOS, help="videos of each kind to reward"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--demos", type=Path, default=Path("demos/rankings"), help="where videos are kept")
    parser.add_argument("--workers", type=int, default=1, help="processes that record videos")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("results/own_videos/compression.csv"))
    arguments = parser.parse_args(words)
    keep_freed_memory()
    torch.set_num_threads(arguments.threads)
    require_at_least(2, **{"--videos": arguments.videos, "--held-out": arguments.held_out})
    setup = Setup(
        arguments.preset, arguments.gradient_steps, arguments.videos, arguments.held_out, arguments.seed
    )
    rows = measure(setup, arguments.task, arguments.demos, arguments.workers)
    write_rows(arguments.out, COLUMNS, rows)
    print(report(rows))


if __name__ == "__main__":
    raise SystemExit(main())
