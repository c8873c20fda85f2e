"""How returns fall with fewer videos and with what phones do to them, and what `demos match` gives back.

    python -m benchmarks.own_videos --task drawn_home --out results/own_videos/drawn_home.csv --work runs/own_videos
    python -m benchmarks.own_videos --task drawn_home --out results/own_videos/drawn_home.csv \
        --figure docs/images/own_videos.png

A task's expert videos are enlarged, disturbed as a camera would, written as mp4 files, imported, matched where the row
says so, and learned from; on `drawn_home` with the reward at rest after alignment. Each row of OUT.csv is one run; rows
that are there are not run again.

- jitter: a hand that trembles by up to 3 % of the picture.
- exposure: brightness that drifts by 15 % within a video, and a white balance of its own.
- h265: HEVC, strongly compressed.
- aspect: 16:9 from farther away, so that the square shows a fifth more than the environment.
- phone: all of them.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
from pathlib import Path
from typing import Any

import av
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from benchmarks.command import command
from benchmarks.resumable_table import ResumableTable
from benchmarks.rows import Row
from bootifol.cli.main import main as bootifol
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.demos.match_set import match_demo_sets
from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.evaluation.summary import summarize
from bootifol.progress import progress
from bootifol.reports.run_files import read_run
from bootifol.reports.style import house_style, save_png
from bootifol.tasks import task_named
from bootifol.types import Frames

SIZES = {"drawn_home": 32, "reacher_hard": 64}
"""Height and width in pixels of the videos that are learned from, by task."""

OPTIONS = {
    "drawn_home": ("--preset", "drawn_pixels", "--interactive.reward-updates-until", "0"),
    "reacher_hard": (
        *("--preset", "frames", "--reward.bootifol.frames.noise", "0.3"),
        *("--interactive.agent-steps", "60000", "--demonstrations.fraction", "0"),
    ),
}
"""Of `bootifol train`, by task."""

FILMED = 256
"""Height in pixels of the files."""

COLUMNS = ("videos", "disturbance", "matched", "seed", "scaled_return", "low", "high", "episodes", "commit")

GRID = (
    (1000, "none", False),
    (200, "none", False),
    (50, "none", False),
    (20, "none", False),
    (50, "phone", False),
    (50, "phone", True),
    (50, "exposure", False),
    (50, "aspect", False),
    (50, "jitter", False),
    (50, "h265", False),
    (200, "phone", False),
    (200, "phone", True),
    (20, "phone", True),
)
"""Videos, disturbance, and whether they were matched; most telling first."""


def disturbed(frames: Frames, kind: str, rng: np.random.Generator) -> Frames:
    """What a camera makes of a video `[n, S, S, 3]`: uint8 `[n, height, width, 3]`."""
    every = kind == "phone"
    shown = np.stack(
        [
            np.asarray(Image.fromarray(frame).resize((FILMED, FILMED), Image.Resampling.BICUBIC))
            for frame in frames
        ]
    )
    if every or kind == "aspect":
        small = round(FILMED / 1.2) // 2 * 2
        above, left, width = (FILMED - small) // 2, 130, round(FILMED * 16 / 9) // 2 * 2
        wide = np.empty((len(frames), FILMED, width, 3), np.uint8)
        wide[:] = shown[0, 0, 0]
        for place, frame in enumerate(shown):
            smaller = Image.fromarray(frame).resize((small, small))
            wide[place, above : above + small, left : left + small] = np.asarray(smaller)
        shown = wide
    if every or kind == "jitter":
        path = rng.normal(0, 1.5, (len(shown), 2)).cumsum(axis=0)
        path = (path - path.mean(0)).clip(-8, 8).round().astype(int)
        padded = np.pad(shown, ((0, 0), (8, 8), (8, 8), (0, 0)), mode="edge")
        height, width = shown.shape[1:3]
        shown = np.stack(
            [
                frame[8 + y : 8 + y + height, 8 + x : 8 + x + width]
                for frame, (y, x) in zip(padded, path, strict=True)
            ]
        )
    if every or kind == "exposure":
        times = np.linspace(0, np.pi, len(shown)) + rng.uniform(0, 2 * np.pi)
        gains = (1 + 0.15 * np.sin(times))[:, None] * np.array([1.15, 1.05, 0.85])
        shown = (shown * gains[:, None, None] + 6).clip(0, 255).astype(np.uint8)
    return shown


def write_file(frames: NDArray[np.uint8], path: Path, kind: str, rate: float) -> None:
    """One mp4 file, H.264 or, where the disturbance says so, H.265."""
    hevc = kind in ("h265", "phone")
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("libx265" if hevc else "libx264", rate=round(rate))
        stream.options = {"crf": "34", "x265-params": "log-level=none"} if hevc else {"crf": "18"}
        stream.height, stream.width = frames.shape[1:3]
        stream.pix_fmt = "yuv420p"
        stream.codec_context.thread_count = 1
        for frame in frames:
            container.mux(
                stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24"))
            )
        container.mux(stream.encode(None))


def demos_of(task: str, work: Path, videos: int, kind: str, matched: bool) -> Path:
    """The demo sets of one row, made once."""
    plain = work / "demos" / f"{videos}_{kind}"
    if not plain.exists():
        expert = DemoSet.open(work / "recorded" / "expert")
        rate = expert.manifest.frames_per_second
        assert rate is not None
        files = work / "files" / f"{videos}_{kind}"
        shutil.rmtree(files, ignore_errors=True)
        files.mkdir(parents=True)
        with progress(f"filming {videos} of {kind}", total=videos) as advance:
            for index in range(videos):
                rng = np.random.default_rng([7, index])
                filmed = disturbed(expert[index].frames, kind, rng)
                write_file(filmed, files / f"{index:04d}.mp4", kind, rate)
                advance()
        import_videos(
            [files], plain / "expert", Conversion(expert.manifest.frames, SIZES[task], frames_per_second=rate)
        )
        shutil.copytree(work / "recorded" / "random", plain / "random")
        shutil.rmtree(files)
    if not matched:
        return plain
    out = work / "demos" / f"{videos}_{kind}_matched"
    if not out.exists():
        match_demo_sets(plain, task_named(task), out)
    return out


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--task", choices=SIZES, required=True)
    parser.add_argument("--out", type=Path, required=True, help="the CSV file")
    parser.add_argument(
        "--work", type=Path, default=Path("runs/own_videos"), help="directory for demos and runs"
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--figure", type=Path, help="draw what the CSV file holds, and run nothing")
    arguments = parser.parse_args()
    table = ResumableTable(arguments.out, COLUMNS, key=4)
    if arguments.figure is not None:
        save_png(drawn(table), arguments.figure)
        return
    task = arguments.task
    pictures = PictureConfig(agent_size=SIZES[task], video_size=SIZES[task])
    record(task, "expert", 1000, arguments.work / "recorded" / "expert", pictures)
    record(task, "random", 200, arguments.work / "recorded" / "random", pictures)
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    )
    for seed in arguments.seeds:
        for videos, kind, matched in GRID:
            if table.has(videos, kind, matched, seed):
                continue
            out = arguments.work / "runs" / f"{videos}_{kind}_{matched}_{seed}"
            shutil.rmtree(out, ignore_errors=True)
            demos = demos_of(task, arguments.work, videos, kind, matched)
            words = ["train", "--task", task, "--demos", str(demos), "--out", str(out)]
            words += ["--seed", str(seed), "--threads", "1", *OPTIONS[task]]
            if bootifol(words) != 0:
                raise SystemExit(1)
            rows = list(read_run(out).evaluations_of(task_named(task).evaluation_steps).values())[-1]
            summary = summarize([row.scaled_return for row in rows if row.scaled_return is not None])
            low, high = summary.interval or (summary.mean, summary.mean)
            values = (videos, kind, matched, seed, f"{summary.mean:.3f}", f"{low:.3f}", f"{high:.3f}")
            table.add(dict(zip(COLUMNS, map(str, (*values, len(rows), commit.stdout.strip())), strict=True)))
    print(f"{arguments.out}: {len(table.rows)} runs")


def drawn(table: ResumableTable) -> Figure:
    """Left returns over the number of undisturbed videos, right over disturbances of 50 videos; a dot a run."""
    with house_style():
        figure = Figure(figsize=(8.4, 3.0), dpi=150, layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        clean = [row for row in table.rows if row["disturbance"] == "none"]
        for row in clean:
            _dot(left, float(row["videos"]), row, "#0B5394")
        left.set_xscale("log")
        ticks = sorted({int(row["videos"]) for row in clean})
        left.set_xticks(ticks, [str(tick) for tick in ticks], minor=False)
        left.minorticks_off()
        left.set_xlabel("videos, undisturbed")
        left.set_ylabel("scaled return")
        fifty = [row for row in table.rows if row["videos"] == "50"]
        order = ["none", "jitter", "exposure", "h265", "aspect", "phone", "phone, matched"]
        kinds = [name for name in order if name in map(_kind, fifty)]
        for row in fifty:
            _dot(right, kinds.index(_kind(row)), row, "#D55E00" if row["matched"] == "True" else "#0B5394")
        right.set_xticks(range(len(kinds)), kinds)
        right.margins(x=0.2)
        right.set_xlabel("what happened to 50 videos")
        for axes in (left, right):
            axes.axhline(1.0, color="#7A7F87", linewidth=0.8)
        return figure


def _kind(row: Row) -> str:
    return row["disturbance"] + (", matched" if row["matched"] == "True" else "")


def _dot(axes: Axes, place: float, row: Row, color: str) -> None:
    value, low, high = (float(row[name]) for name in ("scaled_return", "low", "high"))
    axes.errorbar(
        place, value, yerr=[[value - low], [high - value]], fmt="o", color=color, markersize=4, linewidth=1
    )


if __name__ == "__main__":
    raise SystemExit(main())
