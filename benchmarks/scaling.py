"""How does cost grow with the number of videos, the size of pictures, the length of episodes, and the batch?

    python -m benchmarks.scaling --out results/scaling.csv --picture docs/images/scaling.png

All pixels are random. One thing grows at a time, the rest is the preset's; with `paper` it takes long. Demo sets are
written to disk for this and removed again (5000 videos are 3.7 GB), so they are read from the system's cache as far as
memory reaches. Every time is a median. Finished rows are kept: the same command goes on where it stopped.

The figure has a panel for each thing that grows, on logarithmic axes, with a line of slope 1 beside: what follows it
costs twice as much for twice as much. Markdown tables come out, too; their last column is the slope between the two
largest sizes.
"""

from __future__ import annotations

import argparse
import io
import math
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from benchmarks.command import command
from benchmarks.engine import (
    FRAMES,
    RandomVideos,
    Work,
    agent_update,
    environment_step,
    label_episode,
)
from benchmarks.resumable_table import ResumableTable
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import Manifest, Shard, VideoEntry, write_manifest
from bootifol.demos.shards import sha256_of_frames, videos_per_shard, write_shard
from bootifol.errors import BootifolError, require_at_least
from bootifol.malloc import keep_freed_memory
from bootifol.networks.frame_encoders import picture_sizes
from bootifol.presets import PRESETS, preset
from bootifol.progress import progress
from bootifol.reports.markdown import markdown_table
from bootifol.reports.style import FAINT, RUN_COLORS, RUN_DASHES, house_style, legend_above, save_png
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.training.config import TrainingConfig

COLUMNS = (
    "preset",
    "threads",
    "grows",
    "size",
    "stage",
    "runs",
    "median_ms",
    "lowest_ms",
    "highest_ms",
)
KEY = 5
"""Columns that tell rows apart: all but what was measured."""

SHORTEST_MS = 200.0
"""Quick work is repeated until it has taken this long in all, or `MOST_RUNS` times."""
MOST_RUNS = 200

Prepare = Callable[[], Work]


@dataclass(frozen=True)
class Panel:
    """What one thing's growth does to the stages that it concerns."""

    label: str
    sizes: tuple[int, ...]
    works: Callable[[TrainingConfig, int, Path], dict[str, Prepare]]
    """From the preset, a size and an empty directory to stages; those that cannot have this size are left out."""
    power: int = 1
    """Linear growth follows `size ** power`."""

    def amount(self, size: int) -> int:
        """What the horizontal axis shows of a size."""
        return int(size**self.power)


def growing_videos(config: TrainingConfig, count: int, directory: Path) -> dict[str, Prepare]:
    """A demo set on disk, read as `train` reads it."""
    size, per_class = config.pictures.video_size, config.reward.bootifol.videos_per_class

    @cache
    def path() -> Path:
        return write_random_set(directory, count, size)

    def alignment() -> Work:
        demos = DemoSet.open(path())
        return partial(next, BootifolRewardModel(config.reward.bootifol, size, 0).align(demos, demos))

    return {
        "open the demo set": lambda: partial(DemoSet.open, path()),
        "open it and check every byte": lambda: partial(open_verified, path()),
        "sample a batch of videos": lambda: partial(
            DemoSet.open(path()).sample, per_class, np.random.default_rng(0)
        ),
        "alignment step": alignment,
    }


def growing_pictures(config: TrainingConfig, size: int, _: Path) -> dict[str, Prepare]:
    """The agent reads any size; the reward those that its convolutions bring down to one pixel."""
    config = replace(config, pictures=replace(config.pictures, agent_size=size, video_size=size))
    reward = config.reward.bootifol

    def alignment() -> Work:
        videos = RandomVideos(2 * reward.videos_per_class, size, np.random.default_rng(0))
        return partial(next, BootifolRewardModel(reward, size, 0).align(videos, videos))

    stages: dict[str, Prepare] = {
        "agent step of reacher_hard": lambda: environment_step(config, "reacher_hard").ours,
        "sample and RL update": lambda: agent_update(config).ours,
    }
    if readable(size):
        stages["alignment step"] = alignment
        stages["label an episode"] = lambda: label_episode(config, reward).ours
    return stages


def growing_episodes(config: TrainingConfig, frames: int, _: Path) -> dict[str, Prepare]:
    return {"label an episode": lambda: label_episode(config, config.reward.bootifol, frames).ours}


def growing_batches(config: TrainingConfig, batch_size: int, _: Path) -> dict[str, Prepare]:
    config = replace(config, agent=replace(config.agent, batch_size=batch_size))
    return {"sample and RL update": lambda: agent_update(config).ours}


PANELS = {
    "videos": Panel("videos in the demo set", (10, 50, 200, 1000, 5000), growing_videos),
    "picture": Panel("pixels of a picture", (32, 48, 64, 84, 128), growing_pictures, power=2),
    "frames": Panel("frames of an episode", (15, 30, 61, 121, 251), growing_episodes),
    "batch": Panel("transitions in a batch", (32, 64, 128, 256, 512), growing_batches),
}


def open_verified(path: Path) -> None:
    """Without showing its progress, which would be timed as well."""
    with redirect_stderr(io.StringIO()):
        DemoSet.open(path, verify=True)


def readable(size: int) -> bool:
    """Whether the reward's frame encoder can read pictures of this side."""
    try:
        picture_sizes(size)
    except BootifolError:
        return False
    return True


def write_random_set(directory: Path, count: int, size: int) -> Path:
    """A complete demo set of random pixels, as `bootifol demos record` lays it out; shard by shard.

    Raises:
        BootifolError: the disk has no room for it.
    """
    video_bytes = FRAMES * size * size * 3
    free = shutil.disk_usage(directory).free
    if free < 1.1 * count * video_bytes:
        raise BootifolError(
            f"{count} videos take {count * video_bytes / 1e9:.1f} GB and {directory} has {free / 1e9:.1f} GB left: "
            "choose another --scratch, or fewer --panels"
        )
    rng = np.random.default_rng(count)
    per_shard = videos_per_shard(count, video_bytes)
    shards: list[Shard] = []
    entries: list[VideoEntry] = []
    for first in range(0, count, per_shard):
        in_shard = min(per_shard, count - first)
        videos = rng.integers(0, 256, (in_shard, FRAMES, size, size, 3), dtype=np.uint8)
        shards.append(write_shard(directory, len(shards), videos))
        for number, frames in enumerate(videos, start=first):
            source = {"behavior": "expert", "seed": number}
            entries.append(VideoEntry(f"random-{number:06d}", source, FRAMES, sha256_of_frames(frames)))
    manifest = Manifest(
        name="random",
        complete=True,
        task=None,
        behavior="expert",
        seed=None,
        episodes=count,
        frames=FRAMES,
        video_size=size,
        agent_size=None,
        render_profile=None,
        action_repeat=None,
        frames_per_second=None,
        conversion=None,
        versions={},
        shards=tuple(shards),
        videos=tuple(entries),
    )
    write_manifest(directory, manifest)
    return directory


def milliseconds(work: Work, runs: int) -> list[float]:
    """Of each of so many runs after one that is not counted; of more where they are quick."""
    times: list[float] = []
    work()
    while len(times) < runs or (sum(times) < SHORTEST_MS and len(times) < MOST_RUNS):
        started = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - started))
    return times


def measure(
    table: ResumableTable,
    names: Sequence[str],
    preset_name: str,
    threads: int,
    runs: int,
    scratch: Path | None,
) -> None:
    """Adds to the table what it lacks of these panels."""
    with progress("timing", sum(len(PANELS[name].sizes) for name in names)) as advance:
        for name in names:
            for size in PANELS[name].sizes:
                with tempfile.TemporaryDirectory(dir=scratch) as directory:
                    stages = PANELS[name].works(preset(preset_name), size, Path(directory))
                    for stage, prepare in stages.items():
                        key = (preset_name, threads, name, size, stage)
                        if not table.has(*key):
                            table.add(row(key, milliseconds(prepare(), runs)))
                advance(1)


def row(key: Sequence[object], times: Sequence[float]) -> dict[str, str]:
    measured = (statistics.median(times), min(times), max(times))
    values = [*map(str, key), str(len(times)), *(f"{value:.4g}" for value in measured)]
    return dict(zip(COLUMNS, values, strict=True))


Curve = dict[int, float]
"""Median milliseconds by size."""


def curves(rows: Sequence[Mapping[str, str]], panel: str) -> dict[str, Curve]:
    """The panel's stages, by size from small to large."""
    found: dict[str, Curve] = {}
    for line in sorted(rows, key=lambda line: int(line["size"])):
        if line["grows"] == panel:
            found.setdefault(line["stage"], {})[int(line["size"])] = float(line["median_ms"])
    return found


def last_slope(panel: Panel, curve: Curve) -> float | None:
    """How steep the curve is between its two largest sizes on logarithmic axes; 1 is linear. None of one size."""
    if len(curve) < 2:
        return None
    (before, earlier), (after, later) = list(curve.items())[-2:]
    return math.log(later / earlier) / math.log(panel.amount(after) / panel.amount(before))


def tables(rows: Sequence[Mapping[str, str]]) -> Iterator[str]:
    """A Markdown table of each panel: median milliseconds by size, and the slope at the end."""
    for name, panel in PANELS.items():
        found = curves(rows, name)
        if not found:
            continue
        cells = []
        for stage, curve in found.items():
            slope = last_slope(panel, curve)
            times = [f"{curve[size]:.3g}" if size in curve else "" for size in panel.sizes]
            cells.append([stage, *times, "" if slope is None else f"{slope:.2f}"])
        sizes = [f"{size}²" if panel.power == 2 else str(size) for size in panel.sizes]
        yield markdown_table([f"ms by {panel.label}", *sizes, "last slope"], cells)


def drawn(rows: Sequence[Mapping[str, str]]) -> Figure:
    """The four panels."""
    stages = list(dict.fromkeys(line["stage"] for line in rows))
    with house_style():
        figure = Figure(figsize=(10.4, 6.4), layout="constrained", dpi=120)
        for axes, (name, panel) in zip(figure.subplots(2, 2).flat, PANELS.items(), strict=True):
            draw_panel(axes, panel, curves(rows, name), stages)
        legend_above(figure)
    return figure


def draw_panel(axes: Axes, panel: Panel, found: Mapping[str, Curve], stages: Sequence[str]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks(
        [panel.amount(size) for size in panel.sizes],
        [f"{size}²" if panel.power == 2 else str(size) for size in panel.sizes],
    )
    axes.set_xlabel(panel.label)
    axes.set_ylabel("milliseconds")
    for stage, curve in found.items():
        # Dashes tell apart stages that share a color, of which there are fewer.
        dashes, color = divmod(stages.index(stage), len(RUN_COLORS))
        axes.plot(
            [panel.amount(size) for size in curve],
            list(curve.values()),
            color=RUN_COLORS[color],
            linestyle=RUN_DASHES[dashes],
            marker="o",
            markersize=4,
            label=stage,
        )
    if found:
        ends = [panel.amount(panel.sizes[0]), panel.amount(panel.sizes[-1])]
        highest = 2 * max(max(curve.values()) for curve in found.values())
        line = [highest * end / ends[1] for end in ends]
        axes.plot(ends, line, color=FAINT, linestyle=(0, (5, 3)), linewidth=1.0, label="slope 1")


@command(resumes=True)
def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--preset", default="cpu", choices=list(PRESETS))
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--runs", type=int, default=3, help="timed runs; quick work gets more")
    parser.add_argument("--panels", nargs="+", choices=list(PANELS), default=list(PANELS))
    parser.add_argument("--scratch", type=Path, help="where demo sets are written for a while")
    parser.add_argument("--out", type=Path, default=Path("results/scaling.csv"))
    parser.add_argument("--picture", type=Path, help="a PNG file")
    arguments = parser.parse_args(words)
    keep_freed_memory()
    require_at_least(1, **{"--threads": arguments.threads, "--runs": arguments.runs})
    torch.set_num_threads(arguments.threads)
    table = ResumableTable(arguments.out, COLUMNS, KEY)
    measure(
        table,
        arguments.panels,
        arguments.preset,
        arguments.threads,
        arguments.runs,
        arguments.scratch,
    )
    # One file may hold several presets and thread counts; a picture and its tables show one.
    shown = (arguments.preset, str(arguments.threads))
    rows = [line for line in table.rows if (line["preset"], line["threads"]) == shown]
    print("\n\n".join(tables(rows)))
    if arguments.picture is not None:
        arguments.picture.parent.mkdir(parents=True, exist_ok=True)
        print(f"\nfigure: {save_png(drawn(rows), arguments.picture)}")


if __name__ == "__main__":
    raise SystemExit(main())
