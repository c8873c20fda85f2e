"""The figures of the paper from runs: a line is the mean over seeds, the band its 95 % bootstrap interval."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bootifol.errors import BootifolError
from bootifol.evaluation.summary import summarize
from bootifol.reports.comparison import Comparison, Group, compare
from bootifol.reports.names import task_title
from bootifol.reports.plots import binned, draw_levels, returns_of
from bootifol.reports.run_files import INTERACTIVE, Curve, RunFiles
from bootifol.reports.style import (
    FAINT,
    HALF_WIDTH,
    RUN_COLORS,
    RUN_DASHES,
    agent_step_axis,
    house_style,
    legend_above,
    step_axis,
)

CAPTION = "Bands: 95 % bootstrap intervals over seeds"


@dataclass(frozen=True)
class Band:
    """A mean over time and its interval; all arrays `[N]`."""

    steps: NDArray[np.float64]
    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True)
class Loss:
    """A panel of a figure of losses."""

    title: str
    metrics: tuple[str, ...]
    """The logged losses that it is the sum of."""


def band_over_seeds(curves: Sequence[Curve]) -> Band:
    """Mean and interval of the seeds' curves, from where all have begun to where the first ends.

    Seeds are not measured at the same moments when a time budget ends them, so each curve is read off the straight
    lines between its points.

    Raises:
        BootifolError: the curves have no moment in common.
    """
    first, last = max(curve.steps[0] for curve in curves), min(curve.steps[-1] for curve in curves)
    moments = np.unique(np.concatenate([curve.steps for curve in curves]))
    moments = moments[(moments >= first) & (moments <= last)]
    if not len(moments):
        raise BootifolError("the curves of the seeds have no moment in common; let the shorter run go on")
    values = np.stack([np.interp(moments, curve.steps, curve.values) for curve in curves], axis=1)
    return _band(moments, values)


def returns_figure(comparison: Comparison, by_time: bool = False, scaled: bool = False) -> Figure:
    """Average return of evaluation episodes while agents learn: a panel a task, a line an agent.

    The episodes are the shortest that were evaluated (60 agent steps in the paper); where agents of a task differ in
    that, the shortest that all of them have a curve of. With one seed the band is the interval over its episodes.

    Args:
        comparison: the agents.
        by_time: over minutes of wall-clock time instead of agent steps.
        scaled: returns with 0 for random actions and 1 for the expert, of the shortest episodes that have a scale.

    Raises:
        BootifolError: there is no run, or one was not evaluated as the others of its task.
    """
    require_groups(comparison)
    labels = _legend_labels(comparison.groups)
    colors = {name: number for number, name in enumerate(labels)}
    panels = []
    for task in comparison.tasks():
        groups = comparison.of(task)
        length = _common_length(groups, scaled)
        panels.append((task, length, [(group, _returns(group, length, by_time, scaled)) for group in groups]))
    with house_style():
        figure, all_axes = _panels(len(panels))
        for axes, (task, length, bands) in zip(all_axes, panels, strict=True):
            for group, band in bands:
                _draw(axes, band, colors[group.name], labels[group.name], marked=True)
            axes.set_title(task_title(task), loc="left", fontsize=9.5)
            axes.set_ylabel(f"{'scaled ' if scaled else ''}return of {length}-step episodes")
            if scaled:
                draw_levels(axes, random=0.0, expert=1.0)
            if by_time:
                step_axis(axes, "minutes of wall-clock time")
            else:
                agent_step_axis(axes)
        legend_above(figure)
        _caption(figure, f"{CAPTION}; of a single seed over its episodes")
        return figure


def ablation_figure(
    runs: Sequence[RunFiles], variant: Callable[[RunFiles], str], compared: Collection[str], lacking: str
) -> tuple[Figure, Sequence[str]]:
    """Returns of BootIfOL with and without one of its parts.

    Args:
        runs: from `read_runs`.
        variant: what a run is called in the figure.
        compared: the configuration fields that variants differ in.
        lacking: what to do if there is only one variant, for the error's sentence.

    Returns:
        The figure, and what must be said about it.

    Raises:
        BootifolError: a run is of another method, or there are not two variants among the finished runs.
    """
    for run in runs:
        if run.method != "bootifol":
            raise BootifolError(
                f"{run.path} is of the method {run.method}, but the ablation is of bootifol; leave it out"
            )
    comparison = compare(runs, agent=variant, compared=compared)
    require_groups(comparison)
    variants = list(dict.fromkeys(group.agent for group in comparison.groups))
    if len(variants) < 2:
        left_out = " ".join(["", *comparison.notes])
        raise BootifolError(f"all finished runs are of one variant, {variants[0]}: {lacking}.{left_out}")
    return returns_figure(comparison), comparison.notes


def losses_figure(comparison: Comparison, phase: str, losses: Sequence[Loss]) -> Figure:
    """Losses of one phase: a panel a loss, a line a group of seeds.

    Args:
        comparison: the runs.
        phase: `run_files.ALIGNMENT` or `INTERACTIVE`.
        losses: what to show.

    Raises:
        BootifolError: a run has not logged one of them.
    """
    require_groups(comparison)
    several = len(comparison.tasks()) > 1
    panels = [[_losses(group, phase, loss) for group in comparison.groups] for loss in losses]
    with house_style():
        figure, all_axes = _panels(len(panels))
        for axes, loss, bands in zip(all_axes, losses, panels, strict=True):
            for color, (group, band) in enumerate(zip(comparison.groups, bands, strict=True)):
                task = f"{task_title(group.task)}, " if several else ""
                _draw(axes, band, color, f"{task}{_legend_labels([group])[group.name]}")
            axes.set_title(loss.title, loc="left", fontsize=9.5)
            if axes.get_ylim()[0] > 0:
                axes.set_ylim(bottom=0)
            if phase == INTERACTIVE:
                agent_step_axis(axes)
            else:
                step_axis(axes, "gradient steps")
        legend_above(figure)
        if any(len(group.runs) > 1 for group in comparison.groups):
            _caption(figure, CAPTION)
        return figure


def require_groups(comparison: Comparison) -> None:
    """Refuses a comparison of nothing.

    Raises:
        BootifolError: no run was left to draw; says why.
    """
    if not comparison.groups:
        raise BootifolError(" ".join(["there is no run to draw.", *comparison.notes]))


def _common_length(groups: Sequence[Group], scaled: bool) -> int:
    """Agent steps of the shortest evaluation episodes; where they differ, of the shortest that all have a curve of."""
    runs = [run for group in groups for run in group.runs]
    lengths: dict[int, RunFiles] = {}
    for run in runs:
        if not run.episode_lengths(scaled):
            kind = "scaled evaluations" if scaled else "evaluations"
            raise BootifolError(f"{run.path} has no {kind}; let it train longer, or leave it out")
        lengths.setdefault(run.episode_lengths(scaled)[0], run)
    if len(lengths) == 1:
        return next(iter(lengths))
    curves = [
        {length for length in run.episode_lengths(scaled) if len(run.evaluations_of(length)) > 1}
        for run in runs
    ]
    shared = set.intersection(*curves)
    if not shared:
        told = ", ".join(f"{length} agent steps in {run.path}" for length, run in lengths.items())
        raise BootifolError(f"evaluation episodes differ in length ({told}); draw these runs apart")
    return min(shared)


def _returns(group: Group, length: int, by_time: bool, scaled: bool) -> Band:
    curves, episodes = [], []
    for run in group.runs:
        evaluations = list(run.evaluations_of(length).values())
        moments = [rows[0].seconds / 60 if by_time else rows[0].agent_steps for rows in evaluations]
        episodes = [returns_of(rows, scaled) for rows in evaluations]
        curves.append(Curve(np.array(moments, float), np.array([np.mean(returns) for returns in episodes])))
    if len(curves) > 1:
        return band_over_seeds(curves)
    return _band(curves[0].steps, episodes)


def _losses(group: Group, phase: str, loss: Loss) -> Band:
    return band_over_seeds([_summed(run, phase, loss) for run in group.runs])


def _summed(run: RunFiles, phase: str, loss: Loss) -> Curve:
    """The sum of logged losses where all were logged, in at most 100 means."""
    curves = []
    for name in loss.metrics:
        curve = run.curve(phase, name)
        if curve is None:
            raise BootifolError(
                f"{run.path} has logged no {name} in its {phase.title()} Phase; give bootifol runs whose reward "
                "learns in that phase"
            )
        curves.append(curve)
    steps = curves[0].steps
    for curve in curves[1:]:
        steps = np.intersect1d(steps, curve.steps)
    values = np.sum([np.interp(steps, curve.steps, curve.values) for curve in curves], axis=0)
    total = Curve(steps, values)
    return Curve(binned(total, total.steps, np.mean), binned(total, total.values, np.mean))


def _band(steps: NDArray[np.float64], samples: Sequence[Sequence[float]] | NDArray[np.float64]) -> Band:
    """Mean and interval of the sample at each step."""
    summaries = [summarize(sample, resamples=1000) for sample in samples]
    intervals = [summary.interval or (summary.mean, summary.mean) for summary in summaries]
    return Band(
        steps,
        np.array([summary.mean for summary in summaries]),
        np.array([low for low, _ in intervals]),
        np.array([high for _, high in intervals]),
    )


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(count, 2)
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(columns * HALF_WIDTH[0], rows * 3.5), layout="constrained", dpi=150)
    grid: Any = figure.subplots(rows, columns, squeeze=False)
    axes = list(grid.ravel())
    for unused in axes[count:]:
        unused.remove()
    return figure, axes[:count]


def _draw(axes: Axes, band: Band, number: int, label: str, marked: bool = False) -> None:
    color = RUN_COLORS[number % len(RUN_COLORS)]
    dashes = RUN_DASHES[number // len(RUN_COLORS) % len(RUN_DASHES)]
    axes.fill_between(band.steps, band.low, band.high, color=color, alpha=0.14, linewidth=0)
    marker = "o" if marked and len(band.steps) < 40 else None
    axes.plot(band.steps, band.mean, color=color, linestyle=dashes, marker=marker, markersize=3, label=label)


def _caption(figure: Figure, text: str) -> None:
    figure.supxlabel(text, fontsize=8, color=FAINT, x=0.99, ha="right")


def _legend_labels(groups: Sequence[Group]) -> dict[str, str]:
    """Labels of the legend by name, such as `ViRL, 3 to 5 seeds` where that differs between tasks."""
    counts: dict[str, list[int]] = {}
    for group in groups:
        counts.setdefault(group.name, []).append(len(group.runs))
    labels = {}
    for name, numbers in counts.items():
        told = " to ".join(str(number) for number in dict.fromkeys((min(numbers), max(numbers))))
        labels[name] = f"{name}, {told} seed{'' if told == '1' else 's'}"
    return labels
