"""The reward along episodes from one start, above their film strips: every picture stands at its time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.reports.plots import (
    FAINT,
    KIND_COLORS,
    KIND_NAMES,
    draw_return_curves,
    house_style,
    looks_of,
)
from bootifol.reports.run_files import RunFiles, ShowcaseVideo, read_run

KINDS = ("expert", "agent", "random")
"""Whose pictures are shown, from top to bottom."""

WIDTH = 10.4
"""Width in inches of a figure that fills the page."""

LEFT, RIGHT = 0.08, 0.985
"""Where the pictures begin and end, as shares of the width."""

PICTURES = 10
"""Pictures of a strip."""

PICTURE_SHARE = 0.97
"""Share of its stretch of time that a picture covers; the rest is the gap to the next."""


def videos_of_start(run: RunFiles, start: int) -> dict[str, ShowcaseVideo]:
    """The episodes that begin in one start, by kind, in the order they are shown."""
    return {kind: run.showcase[kind, start] for kind in KINDS if (kind, start) in run.showcase}


def reward_above_film_strip(videos: Mapping[str, ShowcaseVideo]) -> Figure:
    """A figure of the page's width: reward curves, and below them one film strip a kind."""
    with house_style():
        layout = _Layout.of(videos, curve_height=1.9)
        figure = Figure(figsize=(WIDTH, layout.height))
        draw_reward_and_strips(figure, videos, layout)
        return figure


@dataclass(frozen=True)
class _Layout:
    """Where things stand, in inches, on a figure `WIDTH` wide."""

    curve_height: float
    picture_height: float
    strips: int
    top: float = 0.12
    gap: float = 0.07
    bottom: float = 0.45

    @staticmethod
    def of(videos: Mapping[str, ShowcaseVideo], curve_height: float, top: float = 0.12) -> _Layout:
        _, height, width, _ = next(iter(videos.values())).frames.shape
        picture_width = PICTURE_SHARE * WIDTH * (RIGHT - LEFT) / PICTURES
        return _Layout(curve_height, picture_width * float(height / width), len(videos), top)

    @property
    def height(self) -> float:
        strips = self.strips * (self.picture_height + self.gap)
        return self.top + self.curve_height + strips + self.bottom

    def box(self, row: int) -> tuple[float, float, float, float]:
        """Left, bottom, width and height of a row (0: the curves) as shares of the figure."""
        bottom = self.bottom + (self.strips - row) * (self.picture_height + self.gap)
        height = self.picture_height if row else self.curve_height
        return LEFT, bottom / self.height, RIGHT - LEFT, height / self.height


def draw_reward_and_strips(
    figure: Figure | SubFigure, videos: Mapping[str, ShowcaseVideo], layout: _Layout
) -> Axes:
    """Draws reward curves and film strips over the whole figure, on one time axis; returns the axes above."""
    steps = max(len(video.rewards) for video in videos.values())
    curves = figure.add_axes(layout.box(0))
    _draw_rewards(curves, videos, steps)
    for row, (kind, video) in enumerate(videos.items(), start=1):
        strip = figure.add_axes(layout.box(row), sharex=curves)
        _draw_strip(strip, kind, video, steps)
        if row == len(videos):
            strip.set_xlabel("agent steps in the episode")
            strip.tick_params(axis="x", labelbottom=True, length=3)
    return curves


def save_readme_picture(run_dir: Path, out_png: Path) -> None:
    """One PNG of a run for a README: learning curve, reward along videos, and their film strips.

    Raises:
        BootifolError: the run has no evaluations or no showcase yet.
    """
    run = read_run(run_dir)
    starts = run.starts()
    if not starts or not run.evaluations:
        raise BootifolError(
            f"{run_dir} has no {'evaluations' if starts else 'showcase'} to draw; "
            "let its training come to the end"
        )
    videos = videos_of_start(run, starts[0])
    with house_style():
        top = 2.9
        layout = _Layout.of(videos, curve_height=1.6, top=0.4)
        figure = Figure(figsize=(WIDTH, top + layout.height), dpi=150)
        subfigures: Any = figure.subfigures(2, 1, height_ratios=[top, layout.height])
        upper, lower = subfigures
        axes = upper.add_axes((LEFT, 0.18, RIGHT - LEFT, 0.69))
        draw_return_curves(axes, looks_of([run]), scaled=True)
        axes.set_title("Learning curve: 0 is a random agent, 1 the expert", loc="left", fontsize=10)
        curves = draw_reward_and_strips(lower, videos, layout)
        curves.set_title("Learned reward along episodes from one start", loc="left", fontsize=10)
        with written_aside(out_png) as aside:
            figure.savefig(aside, format="png")


def _draw_rewards(axes: Axes, videos: Mapping[str, ShowcaseVideo], steps: int) -> None:
    for kind, video in videos.items():
        axes.plot(
            np.arange(1, len(video.rewards) + 1),
            video.rewards,
            color=KIND_COLORS[kind],
            label=KIND_NAMES[kind],
            linestyle=(0, (1.5, 1.2)) if kind == "random" else "-",
        )
    axes.set_xlim(0, steps)
    axes.set_ylabel("learned reward")
    axes.tick_params(axis="x", labelbottom=False, length=0)
    axes.legend(loc="best", ncols=len(videos))


def _draw_strip(axes: Axes, kind: str, video: ShowcaseVideo, steps: int) -> None:
    """Pictures side by side; each shows the moment at the middle of the time it covers."""
    width = steps / PICTURES
    for number in range(PICTURES):
        moment = int((number + 0.5) * width)
        if moment < len(video.frames):
            left = number * width
            extent = (left, left + PICTURE_SHARE * width, 0.0, 1.0)
            axes.imshow(video.frames[moment], extent=extent, aspect="auto", interpolation="none")
    axes.set_xlim(0, steps)
    axes.set_ylim(0, 1)
    axes.grid(visible=False)
    axes.set_yticks([])
    axes.tick_params(axis="x", labelbottom=False, length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    total = "" if video.environment_return is None else f"\nreturn {video.environment_return:.3g}"
    axes.text(
        -0.008,
        0.5,
        KIND_NAMES[kind],
        transform=axes.transAxes,
        ha="right",
        va="bottom",
        color=KIND_COLORS[kind],
        weight="bold",
    )
    axes.text(-0.008, 0.5, total, transform=axes.transAxes, ha="right", va="center", color=FAINT, fontsize=8)
