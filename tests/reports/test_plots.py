from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from bootifol.evaluation.summary import summarize
from bootifol.reports import plots
from bootifol.reports.film_strip import (
    reward_above_film_strip,
    rewards_above_film_strips,
    videos_of_start,
)
from bootifol.reports.run_files import Curve, RunFiles, read_run
from bootifol.reports.style import KIND_COLORS, RUN_COLORS, svg_data_uri, thousands
from bootifol.types import Video


@pytest.fixture(scope="module")
def run(shared_run: Path) -> RunFiles:
    return read_run(shared_run)


def test_runs_differ_by_method_color_and_seed_dashes(run: RunFiles) -> None:
    other_seed, other_method = replace(run, seed=2), replace(run, method="environment")
    first, second, third = plots.looks_of([run, other_seed, other_method])
    assert first.color == second.color != third.color
    assert first.dashes != second.dashes
    assert [look.label for look in (first, third)] == ["bootifol, seed 1", "environment, seed 1"]


def test_variants_of_one_method_and_seed_are_told_apart_by_directory(run: RunFiles) -> None:
    first, second = plots.looks_of([run, replace(run, path=Path("runs/soft-minimum"))])
    assert first.color != second.color
    assert second.label == "soft-minimum"


def test_directories_are_named_by_as_much_as_tells_them_apart(run: RunFiles) -> None:
    paths = [Path("runs/gaifo/seed1"), Path("runs/virl/seed1")]
    assert [look.label for look in plots.looks_of([replace(run, path=path) for path in paths])] == [
        "gaifo/seed1",
        "virl/seed1",
    ]


def test_unscaled_returns_are_of_the_shortest_episodes_that_all_runs_have(run: RunFiles) -> None:
    final_alone = [row for row in run.evaluations if row.episode_steps == 500]
    figure = plots.return_curves(
        plots.looks_of([run, replace(run, seed=2, evaluations=final_alone)]), scaled=False
    )
    assert figure is not None
    axes = figure.axes[0]
    assert axes.get_ylabel() == "return of 500-step episodes"
    first, second = (np.asarray(line.get_xydata())[-1] for line in axes.lines[:2])
    assert list(first) == list(second)
    other_task = [replace(run, task="hopper_stand"), run]
    assert plots.return_curves(plots.looks_of(other_task), scaled=False) is None
    assert plots.return_curves(plots.looks_of(other_task), scaled=True) is not None


def test_more_runs_than_colors_still_differ(run: RunFiles) -> None:
    looks = plots.looks_of([replace(run, path=Path(f"runs/{i}")) for i in range(10)])
    assert len({(look.color, str(look.dashes)) for look in looks}) == 10


def test_a_curve_shows_the_mean_of_the_episodes(run: RunFiles) -> None:
    """Of those that have a scale, and of the shortest, which have none."""
    looks = plots.looks_of([run])
    for scaled, length in ((True, 500), (False, 60)):
        figure = plots.return_curves(looks, scaled)
        assert figure is not None
        drawn = np.asarray(figure.axes[0].lines[0].get_xydata())
        steps, rows = list(run.evaluations_of(length).items())[7]
        returns = [row.scaled_return if scaled else row.environment_return for row in rows]
        assert drawn[7] == pytest.approx((steps, np.mean(returns)))


def band_at(axes: Axes, when: float) -> tuple[float, float]:
    """The lower and the upper end of the first band of a plot."""
    corners = axes.collections[0].get_paths()[0].vertices
    heights = corners[corners[:, 0] == when, 1]
    return heights.min(), heights.max()


def test_the_band_of_a_curve_is_the_interval_of_the_mean(run: RunFiles) -> None:
    figure = plots.return_curves(plots.looks_of([run]), scaled=True)
    assert figure is not None
    for steps, rows in run.evaluations_of(500).items():
        interval = summarize([row.scaled_return for row in rows], resamples=1000).interval
        assert band_at(figure.axes[0], steps) == pytest.approx(interval)


def test_the_band_of_a_loss_is_the_middle_of_its_bins(run: RunFiles) -> None:
    curve = Curve(np.arange(1000.0), np.tile(np.arange(10.0), 100))
    figure = plots.loss_curves(
        plots.looks_of([replace(run, curves={("alignment", "loss/total"): curve})]), "loss/total"
    )
    assert figure is not None
    assert band_at(figure.axes[0], 4.5) == pytest.approx((0.9, 8.1))  # of 0, 1 … 9, from 10 % to 90 %


def test_nothing_to_draw_gives_no_figure(run: RunFiles) -> None:
    looks = plots.looks_of([replace(run, evaluations=[], curves={})])
    assert plots.return_curves(looks, scaled=True) is None
    assert plots.learned_reward_curves(looks) is None
    assert plots.loss_curves(looks, "loss/sequence") is None


def test_one_evaluation_without_scale_is_drawn(run: RunFiles) -> None:
    row = replace(run.evaluations[0], scaled_return=None)
    looks = plots.looks_of([replace(run, evaluations=[row])])
    assert plots.return_curves(looks, scaled=False) is not None
    assert plots.return_curves(looks, scaled=True) is None


def test_long_curves_are_binned(run: RunFiles) -> None:
    curve = Curve(np.arange(100_000.0), np.ones(100_000))
    figure = plots.loss_curves(
        plots.looks_of([replace(run, curves={("alignment", "loss/total"): curve})]), "loss/total"
    )
    assert figure is not None
    line = np.asarray(figure.axes[0].lines[0].get_xydata())
    assert len(line) == 100
    assert np.all(line[:, 1] == 1.0)


def test_kinds_have_one_color_everywhere(run: RunFiles) -> None:
    figure = plots.ranking_plot(run.ranking_moments()[0])
    strip = reward_above_film_strip(videos_of_start(run, 0))
    assert figure.axes[0].lines[0].get_color() == KIND_COLORS["random"]
    colors = {line.get_label(): line.get_color() for line in strip.axes[0].lines}
    assert colors == {kind: KIND_COLORS[kind] for kind in ("expert", "agent", "random")}


def test_pictures_stand_at_their_time(run: RunFiles) -> None:
    videos = videos_of_start(run, 0)
    strip = reward_above_film_strip(videos).axes[1]
    picture = strip.images[4]
    left, right, _, _ = picture.get_extent()
    moment = int((left + right) / 2)
    assert left <= moment <= right
    shown = [np.array_equal(np.asarray(picture.get_array()), frame) for frame in videos["expert"].frames]
    assert shown[27]
    assert left <= 27 <= right


def test_any_videos_stand_below_their_rewards() -> None:
    """A shorter one ends where it ends."""
    rng = np.random.default_rng(0)
    videos = [
        (
            Video(f"clip {steps}", rng.integers(0, 256, (steps + 1, 8, 8, 3), np.uint8)),
            rng.random(steps).astype(np.float32),
        )
        for steps in (40, 20)
    ]
    curves, first, second = rewards_above_film_strips(videos).axes
    assert [line.get_color() for line in curves.lines] == list(RUN_COLORS[:2])
    for line, (_, rewards) in zip(curves.lines, videos, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), rewards)
    legend = curves.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        f"{number}  {video.name} (mean {rewards.mean():.3g})"
        for number, (video, rewards) in enumerate(videos, start=1)
    ]
    assert (len(first.images), len(second.images)) == (10, 5)
    np.testing.assert_array_equal(np.asarray(second.images[3].get_array()), videos[1][0].frames[14])


def test_the_same_figure_gives_the_same_bytes(run: RunFiles) -> None:
    looks = plots.looks_of([run])
    first, second = (plots.return_curves(looks, scaled=True) for _ in range(2))
    assert first is not None
    assert second is not None
    assert svg_data_uri(first) == svg_data_uri(second)


@pytest.mark.parametrize(("value", "text"), [(950, "950"), (12_000, "12K"), (1_550_000, "1.55M"), (0, "0")])
def test_counts_are_short(value: float, text: str) -> None:
    assert thousands(value) == text


def test_sight_shows_both_moments_of_each_kind() -> None:
    moments = {
        0: {"auc:late": 0.6, "spearman": 0.2},
        900: {"auc:late": 0.9, "auc:still": 1.0, "spearman": 0.5},
    }
    (axes,) = plots.sight_plot(moments).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["still", "late"]
    assert sorted(float(dots.get_offsets()[0][0]) for dots in axes.collections) == [0.6, 0.9, 1.0]
