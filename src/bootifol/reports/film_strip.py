"""The reward along episodes from one start, above their film strips: every picture stands at its time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from bootifol.errors import BootifolError
from bootifol.reports.names import agent_name, task_title
from bootifol.reports.plots import draw_return_curves, looks_of
from bootifol.reports.run_files import RunFiles, ShowcaseVideo
from bootifol.reports.style import FAINT, KIND_COLORS, KIND_NAMES, RUN_COLORS, house_style, short_number
from bootifol.types import Rewards, Video

SHOWN_KINDS = ("expert", "agent", "random")
"""Whose pictures are shown, from top to bottom."""

WIDTH = 10.4
"""Width in inches of a figure that fills the page."""

LEFT, RIGHT = 0.08, 0.985
"""Where the pictures begin and end, as fractions of the width."""

PICTURES = 10
"""Pictures of a strip."""

PICTURE_SHARE = 0.97
"""Fraction of its stretch of time that a picture covers; the rest is the gap to the next."""


def videos_of_start(run: RunFiles, start: int) -> dict[str, ShowcaseVideo]:
    """The episodes that begin in one start, by kind, in the order they are shown."""
    return {kind: run.showcase[kind, start] for kind in SHOWN_KINDS if (kind, start) in run.showcase}


def reward_above_film_strip(videos: Mapping[str, ShowcaseVideo]) -> Figure:
    """A figure of the page's width: reward curves, and below them one film strip a kind."""
    with house_style():
        layout = _Layout.of(videos, curve_height=1.9)
        figure = Figure(figsize=(WIDTH, layout.height))
        draw_reward_and_strips(figure, videos, layout)
        return figure


def rewards_above_film_strips(videos: Sequence[tuple[Video, Rewards]]) -> Figure:
    """The rewards of any videos, and below them one film strip a video, numbered as in the legend.

    Args:
        videos: one to `len(RUN_COLORS)` of them, each with its rewards, which may end before it does.
    """
    shown = {
        f"{number}": ShowcaseVideo("", 0, video.frames, rewards, None, None)
        for number, (video, rewards) in enumerate(videos, start=1)
    }
    colors = dict(zip(shown, RUN_COLORS, strict=False))
    with house_style():
        layout = _Layout.of(shown, curve_height=1.9, top=0.3 + 0.2 * len(videos))
        figure = Figure(figsize=(WIDTH, layout.height), dpi=150)
        curves = draw_reward_and_strips(figure, shown, layout, colors)
        labels = [
            f"{number}  {video.name} (mean {rewards.mean():.3g})"
            for number, (video, rewards) in zip(shown, videos, strict=True)
        ]
        curves.legend(curves.get_lines(), labels, loc="lower left", bbox_to_anchor=(-0.01, 1.0))
        return figure


def expert_above_agent(runs: Sequence[RunFiles], start: int = 0) -> Figure:
    """Film strips of expert and agent from the same start, one pair a run, from the first picture to the last.

    Args:
        runs: from `read_runs`, with a showcase.
        start: which of the showcase's starts, from 0.

    Raises:
        BootifolError: a run has no such start, or no expert.
    """
    pairs = []
    for run in runs:
        videos = {k: v for k, v in videos_of_start(run, start).items() if k in ("expert", "agent")}
        if len(videos) < 2:
            missing = " and ".join(kind for kind in ("expert", "agent") if kind not in videos)
            raise BootifolError(
                f"{run.path} has no film of {missing} from start {start} (it has the starts "
                f"{', '.join(map(str, run.starts())) or 'none'}): a finished run of a task with an expert has them in "
                "showcase.safetensors"
            )
        pairs.append((run, videos))
    with house_style():
        layouts = [_Layout.of(videos, curve_height=0.0, top=0.3) for _, videos in pairs]
        height = sum(layout.height for layout in layouts)
        figure = Figure(figsize=(WIDTH, height), dpi=150)
        top = height
        for (run, videos), layout in zip(pairs, layouts, strict=True):
            top -= layout.height
            steps = max(len(video.rewards) for video in videos.values())
            moments = [round(number * steps / (PICTURES - 1)) for number in range(PICTURES)]
            for row, (kind, video) in enumerate(videos.items(), start=1):
                left, bottom, width, fraction = layout.box(row)
                box = (
                    left,
                    (top + bottom * layout.height) / height,
                    width,
                    fraction * layout.height / height,
                )
                axes = figure.add_axes(box)
                draw_strip(axes, kind, video, steps, moments, KIND_COLORS[kind])
                if row == 1:
                    axes.set_title(f"{task_title(run.task)}: {agent_name(run)}", loc="left", fontsize=9.5)
                    axes.set_xticks([])
                else:
                    middles = [
                        (number + 0.5 * PICTURE_SHARE) * steps / PICTURES for number in range(PICTURES)
                    ]
                    axes.set_xticks(middles, [str(moment) for moment in moments])
                    axes.set_xlabel("agent steps since the start")
                    axes.tick_params(axis="x", labelbottom=True)
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
        """Left, bottom, width and height of a row (0: the curves) as fractions of the figure."""
        bottom = self.bottom + (self.strips - row) * (self.picture_height + self.gap)
        height = self.picture_height if row else self.curve_height
        return LEFT, bottom / self.height, RIGHT - LEFT, height / self.height


def draw_reward_and_strips(
    figure: Figure | SubFigure,
    videos: Mapping[str, ShowcaseVideo],
    layout: _Layout,
    colors: Mapping[str, str] = KIND_COLORS,
) -> Axes:
    """Draws reward curves and film strips over the whole figure, on one time axis; returns the axes above."""
    steps = max(len(video.rewards) for video in videos.values())
    curves = figure.add_axes(layout.box(0))
    _draw_rewards(curves, videos, steps, colors)
    # Each picture shows the moment at the middle of the time it covers.
    moments = [int((number + 0.5) * steps / PICTURES) for number in range(PICTURES)]
    for row, (kind, video) in enumerate(videos.items(), start=1):
        strip = figure.add_axes(layout.box(row), sharex=curves)
        draw_strip(strip, kind, video, steps, moments, colors[kind])
        if row == len(videos):
            strip.set_xlabel("agent steps in the episode")
            strip.tick_params(axis="x", labelbottom=True, length=3)
    return curves


def run_figure(run: RunFiles, start: int = 0) -> Figure:
    """One run on a page: its learning curve, the reward along videos from one start, and their film strips.

    Raises:
        BootifolError: the run has no scaled evaluations, or no such start in its showcase.
    """
    videos = videos_of_start(run, start)
    if not videos or not run.episode_lengths(scaled=True):
        missing = "scaled evaluations" if videos else f"films from start {start}"
        raise BootifolError(f"{run.path} has no {missing} to draw; give a run that has come to its end")
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
        return figure


def _draw_rewards(
    axes: Axes, videos: Mapping[str, ShowcaseVideo], steps: int, colors: Mapping[str, str]
) -> None:
    for kind, video in videos.items():
        axes.plot(
            np.arange(1, len(video.rewards) + 1),
            video.rewards,
            color=colors[kind],
            label=KIND_NAMES.get(kind, kind),
            linestyle=(0, (1.5, 1.2)) if kind == "random" else "-",
        )
    axes.set_xlim(0, steps)
    axes.set_ylabel("learned reward")
    axes.tick_params(axis="x", labelbottom=False, length=0)
    axes.legend(loc="best", ncols=len(videos))


def draw_strip(
    axes: Axes, kind: str, video: ShowcaseVideo, steps: int, moments: Sequence[int], color: str
) -> None:
    """Pictures side by side over an axis of agent steps, one a moment; those past the video's end stay empty."""
    width = steps / len(moments)
    for number, moment in enumerate(moments):
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
    total = "" if video.environment_return is None else f"\nreturn {short_number(video.environment_return)}"
    axes.text(
        -0.008,
        0.5,
        KIND_NAMES.get(kind, kind),
        transform=axes.transAxes,
        ha="right",
        va="bottom",
        color=color,
        weight="bold",
    )
    axes.text(-0.008, 0.5, total, transform=axes.transAxes, ha="right", va="center", color=FAINT, fontsize=8)
