"""The plots of a report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bootifol.evaluation.sight import against_kinds
from bootifol.evaluation.summary import summarize
from bootifol.evaluation.tables import EvaluationRow, RankingRow
from bootifol.reports.run_files import ALIGNMENT, INTERACTIVE, Curve, RunFiles
from bootifol.reports.style import (
    FAINT,
    HALF_WIDTH,
    KIND_COLORS,
    KIND_NAMES,
    RUN_COLORS,
    RUN_DASHES,
    agent_step_axis,
    house_style,
    legend_above,
    step_axis,
)


@dataclass(frozen=True)
class RunLook:
    """How one run is drawn wherever runs are compared."""

    run: RunFiles
    name: str
    """Its directory, with as much of the path as tells it from the others."""

    label: str
    color: str
    dashes: Any


def looks_of(runs: Sequence[RunFiles]) -> list[RunLook]:
    """Gives every run its look: color by method and dashes by seed; a single run has the agent's color.

    Where method and seed do not tell runs apart (variants of one method, or tasks), each has its own color and the
    name of its directory.
    """
    names = _names([run.path for run in runs])
    distinct = len({run.label for run in runs}) == len(runs)
    groups = [run.method if distinct else str(run.path) for run in runs]
    order = list(dict.fromkeys(groups))
    looks = []
    for number, (run, name, group) in enumerate(zip(runs, names, groups, strict=True)):
        color = order.index(group)
        # Dashes tell apart the runs of one group, and the groups that share a color when colors run out.
        dashes = groups[:number].count(group) + color // len(RUN_COLORS)
        looks.append(
            RunLook(
                run=run,
                name=name,
                label=run.label if distinct else name,
                color=RUN_COLORS[color % len(RUN_COLORS)],
                dashes=RUN_DASHES[dashes % len(RUN_DASHES)],
            )
        )
    return looks


def _names(paths: Sequence[Path]) -> list[str]:
    """The last parts of paths, as many as tell them apart."""
    for count in range(1, max(len(path.parts) for path in paths) + 1):
        names = ["/".join(path.parts[-count:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    return [str(path) for path in paths]


def common_length(looks: Sequence[RunLook]) -> int | None:
    """Agent steps of the shortest episodes that all runs were evaluated on, whose returns may stand on one axis.

    None where there are none, or the runs are of several tasks.
    """
    evaluated = [set(look.run.episode_lengths()) for look in looks if look.run.evaluations]
    shared = set.intersection(*evaluated) if evaluated else set()
    return min(shared) if shared and len({look.run.task for look in looks}) == 1 else None


def return_curves(looks: Sequence[RunLook], scaled: bool, by_time: bool = False) -> Figure | None:
    """Evaluation returns over agent steps or minutes, with the levels of expert and random."""
    with house_style():
        figure = Figure(figsize=HALF_WIDTH, layout="constrained")
        if not draw_return_curves(figure.add_subplot(), looks, scaled, by_time):
            return None
        _legend(figure, looks)
        return figure


def draw_return_curves(axes: Axes, looks: Sequence[RunLook], scaled: bool, by_time: bool = False) -> bool:
    """Draws mean and bootstrap interval of each evaluation; False where there is nothing to draw.

    The episodes are those that have a scale, or the shortest that all runs were evaluated on; unscaled returns of
    several tasks are not drawn.
    """
    common = None if scaled else common_length(looks)
    drawn = False
    levels: tuple[float, float] | None = (0.0, 1.0) if scaled else None
    for look in looks:
        lengths = look.run.episode_lengths(scaled=True)
        length = (lengths[0] if lengths else None) if scaled else common
        if length is None:
            continue
        curve = _evaluation_curve(look.run.evaluations_of(length), scaled, by_time)
        if not curve:
            continue
        drawn = True
        levels = levels or look.run.return_levels(length)
        when = np.array([point.when for point in curve])
        mean = np.array([point.mean for point in curve])
        axes.fill_between(
            when,
            [point.low for point in curve],
            [point.high for point in curve],
            color=look.color,
            alpha=0.16 if len(looks) == 1 else 0.09,
            linewidth=0,
        )
        marker = "o" if len(curve) < 40 else None
        axes.plot(
            when, mean, color=look.color, linestyle=look.dashes, marker=marker, markersize=3, label=look.label
        )
        if len(looks) == 1:
            _scatter_episodes(axes, look, length, scaled, by_time)
    if not drawn:
        return False
    if levels is not None:
        draw_levels(axes, *levels)
    axes.set_ylabel("scaled return" if scaled else f"return of {common}-step episodes")
    if by_time:
        step_axis(axes, "minutes of wall-clock time")
    else:
        agent_step_axis(axes)
    return True


def learned_reward_curves(looks: Sequence[RunLook]) -> Figure | None:
    """The learned reward (mean per step) of the agent's training episodes over agent steps."""
    return _metric_figure(looks, [(INTERACTIVE, "episode/learned_reward")], "learned reward per step")


def loss_curves(looks: Sequence[RunLook], name: str) -> Figure | None:
    """One loss in both phases, side by side: each phase has its own horizontal and vertical scale."""
    return _metric_figure(looks, [(ALIGNMENT, name), (INTERACTIVE, name)], "loss")


def metric_curves(looks: Sequence[RunLook], phase: str, name: str) -> Figure | None:
    """Any other metric in one phase."""
    return _metric_figure(looks, [(phase, name)], name.rpartition("/")[2].replace("_", " "))


def ranking_plot(rows: Sequence[RankingRow]) -> Figure:
    """Learned reward of videos by kind: a dot a video, a box over the middle half, a bar at the median."""
    kinds = [kind for kind in KIND_COLORS if any(row.kind == kind for row in rows)]
    with house_style():
        figure = Figure(figsize=(HALF_WIDTH[0], 0.75 + 0.52 * len(kinds)), layout="constrained")
        axes = figure.add_subplot()
        jitter = np.random.default_rng(0)
        for height, kind in enumerate(reversed(kinds)):
            rewards = np.array([row.reward for row in rows if row.kind == kind])
            color = KIND_COLORS[kind]
            low, median, high = np.quantile(rewards, [0.25, 0.5, 0.75])
            axes.barh(height, high - low, left=low, height=0.56, color=color, alpha=0.20, linewidth=0)
            axes.plot([median, median], [height - 0.28, height + 0.28], color=color, linewidth=2.2)
            axes.scatter(
                rewards,
                height + jitter.uniform(-0.2, 0.2, len(rewards)),
                s=13,
                color=color,
                alpha=0.75,
                linewidth=0,
            )
        axes.set_yticks(range(len(kinds)), [KIND_NAMES[kind] for kind in reversed(kinds)])
        axes.set_ylim(-0.55, len(kinds) - 0.45)
        axes.grid(axis="y", visible=False)
        axes.grid(axis="x", visible=True)
        axes.spines["left"].set_visible(False)
        axes.set_xlabel("learned reward, summed over the video")
        return figure


def sight_plot(moments: Mapping[int, Mapping[str, float]]) -> Figure:
    """The chance that the expert is rewarded above each kind of failure: hollow after alignment, full at the end."""
    first, last = (against_kinds(dict(list(moments.values())[at])) for at in (0, -1))
    kinds = list({**last, **first})
    with house_style():
        figure = Figure(figsize=(HALF_WIDTH[0], 0.75 + 0.26 * len(kinds)), layout="constrained")
        axes = figure.add_subplot()
        for height, kind in enumerate(reversed(kinds)):
            for against, filled in ((first, False), (last, True)):
                if kind in against:
                    color = KIND_COLORS["expert"]
                    axes.scatter(
                        against[kind], height, s=34, facecolor=color if filled else "none", edgecolor=color
                    )
        axes.axvline(0.5, color=FAINT, linewidth=1)
        axes.set_xlim(-0.03, 1.03)
        axes.set_yticks(range(len(kinds)), [kind.replace("_", " ") for kind in reversed(kinds)])
        axes.set_ylim(-0.6, len(kinds) - 0.4)
        axes.set_xlabel("fraction of pairs in which the expert is rewarded above it")
        return figure


@dataclass(frozen=True)
class _Point:
    when: float
    """Agent steps or minutes."""

    mean: float
    low: float
    high: float


def _evaluation_curve(grouped: dict[int, list[EvaluationRow]], scaled: bool, by_time: bool) -> list[_Point]:
    points = []
    for rows in grouped.values():
        values = returns_of(rows, scaled)
        if values:
            summary = summarize(values, resamples=1000)
            low, high = summary.interval or (summary.mean, summary.mean)
            points.append(_Point(_when(rows[0], by_time), summary.mean, low, high))
    return points


def _when(row: EvaluationRow, by_time: bool) -> float:
    return row.seconds / 60 if by_time else float(row.agent_steps)


def returns_of(rows: Sequence[EvaluationRow], scaled: bool) -> list[float]:
    """The returns of episodes; scaled on request, where they have a scale."""
    if scaled:
        return [row.scaled_return for row in rows if row.scaled_return is not None]
    return [row.environment_return for row in rows]


def _scatter_episodes(axes: Axes, look: RunLook, episode_steps: int, scaled: bool, by_time: bool) -> None:
    points = [
        (_when(rows[0], by_time), value)
        for rows in look.run.evaluations_of(episode_steps).values()
        for value in returns_of(rows, scaled)
    ]
    when, values = zip(*points, strict=True)
    axes.scatter(when, values, s=7, color=look.color, alpha=0.22, linewidth=0)


def draw_levels(axes: Axes, random: float, expert: float) -> None:
    """Two level lines with their names, and room for them."""
    # The curve starts near random and ends near the expert: the labels stand at the other ends.
    for kind, level, side, align in (("expert", expert, 0.01, "left"), ("random", random, 0.99, "right")):
        axes.axhline(level, color=KIND_COLORS[kind], linewidth=1.1, linestyle=(0, (4, 3)), zorder=1)
        axes.annotate(
            kind,
            (side, level),
            xycoords=("axes fraction", "data"),
            xytext=(0, 2.5),
            textcoords="offset points",
            ha=align,
            va="bottom",
            fontsize=8,
            color=KIND_COLORS[kind],
        )
    bottom, top = axes.get_ylim()
    room = 0.09 * (expert - random)
    axes.set_ylim(min(bottom, random - room), max(top, expert + 1.5 * room))


def _metric_figure(looks: Sequence[RunLook], panels: Sequence[tuple[str, str]], ylabel: str) -> Figure | None:
    present = [panel for panel in panels if any(_is_drawable(look.run.curve(*panel)) for look in looks)]
    if not present:
        return None
    with house_style():
        figure = Figure(figsize=HALF_WIDTH, layout="constrained")
        for number, (phase, name) in enumerate(present):
            axes = figure.add_subplot(1, len(present), number + 1)
            for look in looks:
                curve = look.run.curve(phase, name)
                if curve is not None and _is_drawable(curve):
                    _draw_binned(axes, curve, look, alone=len(looks) == 1)
            if len(panels) > 1:
                axes.set_title(
                    "Alignment Phase" if phase == ALIGNMENT else "Interactive Phase",
                    fontsize=8.5,
                    loc="left",
                    color=FAINT,
                )
            if number == 0:
                axes.set_ylabel(ylabel)
            if name.startswith("loss/") and axes.get_ylim()[0] > 0:
                axes.set_ylim(bottom=0)
            if phase == INTERACTIVE:
                agent_step_axis(axes)
            else:
                step_axis(axes, "gradient steps")
        _legend(figure, looks)
        return figure


def _legend(figure: Figure, looks: Sequence[RunLook]) -> None:
    """A legend above the plots, where several runs are compared."""
    if len(looks) > 1:
        legend_above(figure)


def _is_drawable(curve: Curve | None) -> bool:
    return curve is not None and len(curve) > 1


def _draw_binned(axes: Axes, curve: Curve, look: RunLook, alone: bool) -> None:
    """The mean of about 100 bins as a line; with one run, the range of each bin's middle 80 % behind it."""
    steps = binned(curve, curve.steps, np.mean)
    axes.plot(
        steps,
        binned(curve, curve.values, np.mean),
        color=look.color,
        linestyle=look.dashes,
        label=look.label,
    )
    if alone:
        low = binned(curve, curve.values, lambda values: np.quantile(values, 0.1))
        high = binned(curve, curve.values, lambda values: np.quantile(values, 0.9))
        axes.fill_between(steps, low, high, color=look.color, alpha=0.16, linewidth=0)


def binned(
    curve: Curve, values: NDArray[np.float64], reduce: Callable[[NDArray[np.float64]], Any], bins: int = 100
) -> NDArray[np.float64]:
    """The values in about equal parts, each reduced to a number; at most `bins` of them."""
    parts = np.array_split(values, min(bins, len(curve)))
    return np.array([float(reduce(part)) for part in parts])
