"""Does a learned reward see the task? One reward, aligned for minutes, against the expert and plausible failures.

    python -m benchmarks.sight reacher_hard --demos demos/reacher_hard --videos 200 --minutes 5 --out results/sight.csv

A row a measure (`evaluation/sight.py`): task, reward, videos, measure, value. Rewards: `bootifol` is the one that the
presets take, `sequences` the paper's objective as the presets had it, and every other method by its name. Rows of the
same task, reward and videos are replaced; the command prints a table of the task. `--picture FILE.png` shows what it
confuses: an episode of the expert above those failures that it rewards most.
"""

from __future__ import annotations

import argparse
import csv
import time
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from rich.console import Console

from benchmarks.command import command
from bootifol.demos.demo_set import DemoSet, VideoSubset
from bootifol.demos.fit import look_alike
from bootifol.demos.manifest import find_demo_sets
from bootifol.errors import BootifolError
from bootifol.evaluation.sight import Performance, against_kinds, failures, perform, returns, sight
from bootifol.files import written_aside
from bootifol.presets import preset
from bootifol.progress import progress
from bootifol.reports.film_strip import rewards_above_film_strips
from bootifol.reports.markdown import markdown_table
from bootifol.reports.style import require_png, save_png
from bootifol.rewards.base import RewardModel
from bootifol.rewards.references import draw_references
from bootifol.rewards.registry import make_reward_model
from bootifol.tasks import make_environment, task_named
from bootifol.types import Metrics, OtherCamera, Rewards, Video, VideoSource

HEADER = ("task", "reward", "videos", "measure", "value")
REWARDS = ("bootifol", "sequences", "gaifo", "virl", "context_translation")
Row = dict[str, str]


def aligned(
    reward: str, preset_name: str, demos: Path, videos: int, minutes: float, seed: int
) -> tuple[RewardModel, VideoSubset]:
    """The reward after its Alignment Phase, or after as many minutes, and the expert videos it learned from."""
    config = preset(preset_name, "bootifol" if reward == "bootifol" else "sequences")
    method = "bootifol" if reward in ("bootifol", "sequences") else reward
    model = make_reward_model(method, config.reward, config.pictures.video_size, seed)
    paths = find_demo_sets(demos)
    sets = [DemoSet.open(paths[kind], verify=False) for kind in ("expert", "random")]
    expert, other = (VideoSubset(demo_set, range(min(videos, len(demo_set)))) for demo_set in sets)
    others: VideoSource = other
    if reward == "bootifol" and not look_alike(*(demo_set.manifest for demo_set in sets)):
        others = OtherCamera(other)
    steps = config.alignment.gradient_steps
    # ViRL learns nothing before the agent acts; here it learns from the same videos for as long.
    metrics = (
        model.align(expert, others) if method != "virl" else iter(lambda: model.update(expert, other), None)
    )
    end = time.monotonic() + 60 * minutes
    with progress(f"aligning {reward} ({preset_name})", steps) as advance:
        for _ in islice(metrics, steps):
            advance(1)
            if time.monotonic() > end:
                break
    return model, expert


def judged(
    task: str, preset_name: str, model: RewardModel, expert: VideoSubset, episodes: int
) -> tuple[list[Performance], list[Video]]:
    """Everyone plays; the performances and their videos."""
    environment = make_environment(task, preset(preset_name).pictures, task_named(task).episode_steps)
    rng = np.random.default_rng(0)
    videos: list[Video] = []

    def label(video: Video) -> Rewards:
        videos.append(video)
        return model.label(video, draw_references(model, expert, rng))

    performances = []
    with progress("judging", 0) as advance:
        for performance in perform(task, environment, label, episodes):
            performances.append(performance)
            advance(1)
    return performances, videos


def confused(performances: list[Performance], figures: Metrics) -> list[int]:
    """An episode of the expert, the one of median learned return, and then of each of the three kinds that are told
    from it worst the failure of highest learned return."""
    _, learned = returns(performances)
    names = np.array([performance.performer for performance in performances])
    failing = failures(performances)
    of_expert = np.flatnonzero(names == "expert")
    against = against_kinds(figures)
    chosen = [int(of_expert[np.argsort(learned[of_expert])[len(of_expert) // 2]])]
    for kind in sorted(against, key=against.__getitem__)[:3]:
        failed = np.flatnonzero((names == kind) & failing)
        chosen.append(int(failed[np.argmax(learned[failed])]))
    return chosen


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("task", help="from the catalogue")
    parser.add_argument("--demos", type=Path, required=True, help="directory of its demo sets")
    parser.add_argument("--reward", choices=REWARDS, default="bootifol")
    parser.add_argument("--preset", default=None, help="frames, or drawn for the drawn tasks, unless given")
    parser.add_argument("--videos", type=int, default=200, help="expert videos, and as many random ones")
    parser.add_argument("--name", help="how the videos column calls them, instead of their number")
    parser.add_argument("--minutes", type=float, default=5.0, help="longest Alignment Phase")
    parser.add_argument("--episodes", type=int, default=40, help="of each performer")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--picture", type=Path, help="PNG of what the reward confuses")
    parser.add_argument("--out", type=Path, required=True, help="CSV to write rows into")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    if arguments.picture:
        require_png(arguments.picture)
    if not task_named(arguments.task).has_expert:
        raise BootifolError(
            f"{arguments.task} has no expert to compare failures with: choose one of `bootifol tasks`"
        )
    chosen = arguments.preset or ("drawn" if arguments.task.startswith("drawn") else "frames")
    model, expert = aligned(
        arguments.reward, chosen, arguments.demos, arguments.videos, arguments.minutes, arguments.seed
    )
    performances, videos = judged(arguments.task, chosen, model, expert, arguments.episodes)
    true, learned = returns(performances)
    names = np.array([performance.performer for performance in performances])
    figures = sight(performances)
    cells = [
        (
            kind,
            f"{true[names == kind].mean():.1f}",
            f"{learned[names == kind].mean():.2f}",
            f"{figures[f'auc:{kind}']:.2f}" if f"auc:{kind}" in figures else "–",
        )
        for kind in dict.fromkeys(names)
    ]
    console = Console()
    console.print(markdown_table(("performer", "true return", "learned return", "expert above it"), cells))
    console.print(
        ", ".join(f"{name} {value:.2f}" for name, value in figures.items() if not name.startswith("auc:"))
    )
    if arguments.picture:
        shown = confused(performances, figures)
        console.print("from above: " + ", ".join(names[shown]))
        strips = rewards_above_film_strips([(videos[i], performances[i].learned_rewards) for i in shown])
        save_png(strips, arguments.picture)
    key = {"task": arguments.task, "reward": arguments.reward, "videos": arguments.name or str(len(expert))}
    write(arguments.out, key, figures)


def write(path: Path, key: Row, figures: Metrics) -> None:
    """Replaces the rows of a task, reward and videos, and keeps all others."""
    rows: list[Row] = []
    if path.is_file():
        with path.open(newline="") as file:
            rows = [
                row for row in csv.DictReader(file) if any(row[name] != value for name, value in key.items())
            ]
    rows += [{**key, "measure": name, "value": f"{value:.4f}"} for name, value in figures.items()]
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_aside(path) as aside, aside.open("w", newline="") as file:
        writer = csv.DictWriter(file, HEADER)
        writer.writeheader()
        writer.writerows(
            sorted(rows, key=lambda row: (row["task"], row["reward"], row["videos"], row["measure"]))
        )


if __name__ == "__main__":
    raise SystemExit(main())
