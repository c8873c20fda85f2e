"""Does a short alignment teach the reward to rank videos, in every task of the paper?

    python -m benchmarks.task_rankings --out results/tasks/rankings.csv --picture docs/images/task_rankings.png

For each task: expert and random videos are recorded to learn from, and expert, half-good and random ones, from other
starts, to be ranked. The preset's reward model is aligned on the former and rewards the latter, each against expert
videos of training as an episode of an agent would be. AUC is the chance that a better video is rewarded above a worse
one (0.5: a coin); Kendall's tau says the same of all three kinds at once. Intervals are 95 % bootstrap intervals over
the ranked videos: how much another training would differ they do not tell, and where every pair is in order they have
no width.

Beside OUT.csv, OUT_videos.csv holds every video's reward. Tasks that are in them with the same settings are not
measured again, so the same command goes on where it stopped. Tasks without an expert are named and left out.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.command import command
from benchmarks.rows import Row, read_rows, write_rows
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.record import HALF_GOOD_VIDEOS, record_demos
from bootifol.errors import BootifolError, require_at_least
from bootifol.evaluation.ranking import (
    KINDS,
    RankingIntervals,
    RankingScores,
    expert_above_random,
    rank_videos,
    ranking_intervals,
    ranking_scores,
)
from bootifol.evaluation.tables import RankingRow
from bootifol.experts.behaviors import Behavior
from bootifol.malloc import keep_freed_memory
from bootifol.presets import preset
from bootifol.progress import progress
from bootifol.reports.markdown import markdown_table
from bootifol.reports.paper_results import RETURNS
from bootifol.reports.style import KIND_COLORS, KIND_NAMES, house_style, save_png
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.tasks import TASKS, Task
from bootifol.types import Video, VideoSource

SETTINGS = ("preset", "gradient_steps", "training_videos", "held_out_videos", "seed")
MEASURES = ("kendall_tau", "expert_above_half_good", "half_good_above_random", "expert_above_random")
MEASURE_NAMES = ("Kendall's tau", "expert > half-good", "half-good > random", "expert > random")
COLUMNS = (
    "task",
    *SETTINGS,
    *(f"{measure}{end}" for measure in MEASURES for end in ("", "_low", "_high")),
    "perfect_tau",
)
VIDEO_COLUMNS = ("task", *SETTINGS, "kind", "video", "reward")

HELD_OUT_SEED = 1000
"""Added to the seed of training videos: held-out ones begin elsewhere."""


@dataclass(frozen=True)
class Setup:
    """What decides a ranking, besides the task."""

    preset: str
    gradient_steps: int
    training_videos: int
    """Of each kind that is learned from, expert and random."""
    held_out_videos: int
    """Of each of `KINDS`."""
    seed: int

    def columns(self) -> Row:
        return {name: str(getattr(self, name)) for name in SETTINGS}


def ranked(task: Task, setup: Setup, demos: Path, workers: int) -> list[RankingRow]:
    """Records what is missing, aligns the reward, and rewards the held-out videos."""
    training, held_out = recorded(task, setup, demos, workers)
    model = aligned(task, setup, training["expert"], training["random"])
    rng = np.random.default_rng(setup.seed)
    return rank_videos(model, held_out, training["expert"], rng, agent_steps=0)


def recorded(
    task: Task, setup: Setup, demos: Path, workers: int
) -> tuple[dict[Behavior, DemoSet], dict[str, list[Video]]]:
    """Expert and random videos to learn from, and held-out ones by kind; recorded where they are missing."""
    config = preset(setup.preset)
    training = record_demos(
        task.name,
        demos / task.name / "training",
        setup.training_videos,
        ("expert", "random"),
        config.pictures,
        setup.seed,
        workers=workers,
    )
    aside = record_demos(
        task.name,
        demos / task.name / "held_out",
        setup.held_out_videos,
        ("expert", "half_good", "random"),
        config.pictures,
        setup.seed + HELD_OUT_SEED,
        workers=workers,
    )
    # Their names are those of the training videos, with the same numbers; caches of encodings go by the name.
    held_out: dict[str, list[Video]] = {
        kind: [
            replace(video, name=f"held-out-{video.name}")
            for video in map(videos.__getitem__, range(len(videos)))
        ]
        for kind, videos in aside.items()
    }
    return training, held_out


def aligned(task: Task, setup: Setup, expert: VideoSource, random: VideoSource) -> BootifolRewardModel:
    """The preset's reward model after its alignment on these videos."""
    config = preset(setup.preset)
    model = BootifolRewardModel(config.reward.bootifol, config.pictures.video_size, setup.seed)
    steps = model.align(expert, random)
    with progress(f"{task.name}, aligning", setup.gradient_steps) as advance:
        for _ in range(setup.gradient_steps):
            metrics = next(steps)
            advance(1, sequence_loss=metrics["loss/sequence"])
    return model


def rank_all(
    tasks: Sequence[Task], setup: Setup, demos: Path, workers: int, out: Path
) -> dict[str, list[RankingRow]]:
    """Ranks the tasks that the files lack and writes both after each.

    Returns:
        The rewards of the held-out videos by task, of the tasks asked for that have an expert.
    """
    videos_out = out.with_name(f"{out.stem}_videos.csv")
    rows, video_rows = read_rows(out, COLUMNS), read_rows(videos_out, VIDEO_COLUMNS)
    order = list(TASKS)
    for task in tasks:
        about = {"task": task.name, **setup.columns()}
        # Both: without its videos a task's panel of the picture would be empty.
        if all(any(about.items() <= row.items() for row in table) for table in (rows, video_rows)):
            continue
        rewards = ranked(task, setup, demos, workers)
        described = {
            **about,
            **described_scores(
                ranking_scores(rewards), ranking_intervals(rewards), expert_above_random(rewards)
            ),
        }
        new_videos = [
            {**about, "kind": row.kind, "video": row.video, "reward": f"{row.reward:.6g}"} for row in rewards
        ]
        video_rows = [row for row in video_rows if row["task"] != task.name] + new_videos
        rows = [row for row in rows if row["task"] != task.name] + [described]
        # The videos first: a table that names a task has its videos.
        for path, columns, whole in (
            (videos_out, VIDEO_COLUMNS, video_rows),
            (out, COLUMNS, rows),
        ):
            write_rows(path, columns, sorted(whole, key=lambda row: order.index(row["task"])))
    return {
        task.name: [
            RankingRow(0, row["kind"], row["video"], float(row["reward"]))
            for row in video_rows
            if row["task"] == task.name
        ]
        for task in tasks
    }


def described_scores(scores: RankingScores, intervals: RankingIntervals, above_random: float) -> Row:
    """The columns of the table that were measured."""
    values = {name: getattr(scores, name) for name in MEASURES[:3]} | {"expert_above_random": above_random}
    row: Row = {"perfect_tau": f"{scores.perfect_tau:.4f}"}
    for name, value in values.items():
        low, high = getattr(intervals, name)
        row |= {name: f"{value:.4f}", f"{name}_low": f"{low:.4f}", f"{name}_high": f"{high:.4f}"}
    return row


def report(rows: Sequence[Row]) -> str:
    """The table in Markdown."""
    cells = [
        [
            f"`{row['task']}`",
            *(
                f"{float(row[name]):.2f} ({float(row[f'{name}_low']):.2f} … {float(row[f'{name}_high']):.2f})"
                for name in MEASURES
            ),
            f"{float(row['perfect_tau']):.2f}",
        ]
        for row in rows
    ]
    return markdown_table(["task", *MEASURE_NAMES, "tau of a perfect order"], cells)


def draw(rewards: dict[str, list[RankingRow]], rows: Sequence[Row], path: Path) -> None:
    """A panel a task with every video's reward, and one with the AUCs of all tasks."""
    columns = min(4, len(rewards) + 1)
    lines = -(-(len(rewards) + 1) // columns)
    with house_style():
        figure = Figure(figsize=(3.0 * columns, 2.9 * lines), layout="constrained", dpi=120)
        panels = list(np.ravel(figure.subplots(lines, columns, squeeze=False)))
        for axes, row in zip(panels, rows, strict=False):
            draw_task(axes, rewards[row["task"]], row)
        draw_areas(panels[len(rewards)], rows)
        for axes in panels[len(rewards) + 1 :]:
            axes.set_axis_off()
    save_png(figure, path)


def draw_task(axes: Axes, rewards: Sequence[RankingRow], row: Row) -> None:
    """Learned rewards by kind: a dot a video, a bar at the median."""
    jitter = np.random.default_rng(0)
    for place, kind in enumerate(KINDS):
        values = np.array([one.reward for one in rewards if one.kind == kind])
        across = place + jitter.uniform(-0.22, 0.22, len(values))
        axes.scatter(across, values, s=12, color=KIND_COLORS[kind], alpha=0.7, linewidth=0)
        median = float(np.median(values))
        axes.plot([place - 0.32, place + 0.32], [median, median], color=KIND_COLORS[kind], linewidth=2.2)
    axes.set_xticks(range(len(KINDS)), [KIND_NAMES[kind] for kind in KINDS])
    axes.set_ylabel("learned reward of a video")
    tau, perfect = float(row["kendall_tau"]), float(row["perfect_tau"])
    axes.set_title(f"{row['task']}: tau {tau:.2f} of {perfect:.2f}", loc="left", fontsize=9)


def draw_areas(axes: Axes, rows: Sequence[Row]) -> None:
    """AUC of neighboring kinds with intervals, a line a task."""
    looks = (("expert_above_half_good", "expert", -0.13), ("half_good_above_random", "half_good", 0.13))
    for (name, kind, shift), label in zip(looks, MEASURE_NAMES[1:3], strict=True):
        values, low, high = (
            np.array([float(row[f"{name}{end}"]) for row in rows]) for end in ("", "_low", "_high")
        )
        # The interval may lie beside the estimate by rounding.
        ends = np.maximum([values - low, high - values], 0.0)
        axes.errorbar(
            values,
            np.arange(len(rows)) + shift,
            xerr=ends,
            fmt="o",
            markersize=4,
            elinewidth=1.4,
            color=KIND_COLORS[kind],
            label=label,
        )
    axes.axvline(0.5, color=KIND_COLORS["random"], linewidth=1.0, linestyle=(0, (4, 3)))
    axes.set_yticks(range(len(rows)), [row["task"] for row in rows], fontsize=8)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(min(0.4, axes.get_xlim()[0]), 1.02)
    axes.set_xlabel("AUC (0.5: a coin)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.4, 1.2), ncols=2, fontsize=7.5, handletextpad=0.2)


@command(resumes=True)
def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tasks", nargs="+", default=list(RETURNS), choices=list(TASKS), help="the seven by default"
    )
    parser.add_argument("--preset", default="cpu", help="whose pictures and reward model")
    parser.add_argument("--gradient-steps", type=int, help="of each alignment; the preset's by default")
    parser.add_argument("--videos", type=int, default=200, help="expert and random videos each to learn from")
    parser.add_argument("--held-out", type=int, default=HALF_GOOD_VIDEOS, help="videos of each kind to rank")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--demos", type=Path, default=Path("demos/rankings"), help="where videos are kept")
    parser.add_argument("--workers", type=int, default=1, help="processes that record videos")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("results/tasks/rankings.csv"))
    parser.add_argument("--picture", type=Path, help="also draw the rankings into this PNG")
    arguments = parser.parse_args(words)
    keep_freed_memory()
    torch.set_num_threads(arguments.threads)
    # One number would do in all, but one video of a kind has no spread.
    require_at_least(2, **{"--videos": arguments.videos, "--held-out": arguments.held_out})
    if arguments.held_out > HALF_GOOD_VIDEOS:
        raise BootifolError(
            f"--held-out is at most {HALF_GOOD_VIDEOS}, as many half-good videos as are recorded, "
            f"not {arguments.held_out}"
        )
    tasks = [TASKS[name] for name in arguments.tasks]
    steps = arguments.gradient_steps
    steps = preset(arguments.preset).alignment.gradient_steps if steps is None else steps
    setup = Setup(arguments.preset, steps, arguments.videos, arguments.held_out, arguments.seed)
    for task in tasks:
        if not task.has_expert:
            print(f"{task.name} is left out: no expert is bundled yet, so there are no videos to rank")
    tasks = [task for task in tasks if task.has_expert]
    if not tasks:
        return
    rewards = rank_all(tasks, setup, arguments.demos, arguments.workers, arguments.out)
    rows = [row for row in read_rows(arguments.out, COLUMNS) if row["task"] in rewards]
    print(report(rows))
    if arguments.picture is not None:
        draw(rewards, rows, arguments.picture)
        print(arguments.picture)


if __name__ == "__main__":
    raise SystemExit(main())
