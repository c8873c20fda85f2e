from pathlib import Path

import numpy as np
import pytest
from made_up_runs import write_run
from matplotlib.axes import Axes
from PIL import Image
from synthetic_run import AGENT_STEPS

from benchmarks import figure as figures
from bootifol.errors import BootifolError
from bootifol.evaluation.tables import EvaluationRow, append_evaluations
from bootifol.reports.collection import add_to_collection
from bootifol.reports.comparison import Comparison, compare
from bootifol.reports.figures import Loss, band_over_seeds, losses_figure, returns_figure
from bootifol.reports.film_strip import expert_above_agent, run_figure
from bootifol.reports.run_files import Curve, find_runs, read_run

CURVE = {100: [10.0, 20.0], 200: [30.0, 50.0]}


def comparison_of(root: Path) -> Comparison:
    return compare([read_run(run_dir) for run_dir in find_runs([root])])


def points(axes: Axes, line: int = 0) -> np.ndarray:
    return np.asarray(axes.lines[line].get_xydata())


def test_seeds_are_averaged_where_all_are_known() -> None:
    early = Curve(np.array([0.0, 100.0, 200.0]), np.array([0.0, 10.0, 20.0]))
    late = Curve(np.array([50.0, 150.0]), np.array([1.0, 3.0]))
    band = band_over_seeds([early, late])
    assert band.steps.tolist() == [50.0, 100.0, 150.0]
    # The first is 5, 10 and 15 there, the second 1, 2 and 3.
    assert band.mean == pytest.approx([3.0, 6.0, 9.0])
    assert band.low == pytest.approx([1.0, 2.0, 3.0])
    assert band.high == pytest.approx([5.0, 10.0, 15.0])


def test_seeds_without_a_common_moment_are_refused() -> None:
    one, two = (Curve(np.array([step]), np.array([1.0])) for step in (1.0, 2.0))
    with pytest.raises(BootifolError, match="no moment in common"):
        band_over_seeds([one, two])


def test_returns_have_a_panel_a_task_and_a_line_an_agent(tmp_path: Path) -> None:
    write_run(tmp_path / "a", seed=1, curve=CURVE)
    write_run(tmp_path / "b", seed=2, curve={100: [0.0, 0.0], 200: [20.0, 20.0]})
    write_run(tmp_path / "c", method="virl", curve=CURVE)
    write_run(tmp_path / "d", method="virl", task="hopper_stand", curve=CURVE)
    figure = returns_figure(comparison_of(tmp_path))
    reacher, hopper = figure.axes
    assert points(reacher) == pytest.approx(np.array([(100.0, 7.5), (200.0, 30.0)]))
    assert points(reacher, 1) == pytest.approx(np.array([(100.0, 15.0), (200.0, 40.0)]))
    assert [line.get_label() for line in reacher.lines] == ["BootIfOL, 2 seeds", "ViRL, 1 seed"]
    assert [text.get_text() for text in figure.legends[0].texts] == ["BootIfOL, 2 seeds", "ViRL, 1 seed"]
    assert hopper.lines[0].get_color() == reacher.lines[1].get_color()
    assert reacher.get_ylabel() == "return of 60-step episodes"


def test_returns_over_time_stand_at_their_minutes(tmp_path: Path) -> None:
    write_run(tmp_path / "a", seconds=600.0, curve=CURVE)
    axes = returns_figure(comparison_of(tmp_path), by_time=True).axes[0]
    assert points(axes)[:, 0] == pytest.approx([1.0, 2.0])


def test_scaled_returns_are_of_episodes_that_have_a_scale(tmp_path: Path) -> None:
    for seed, final in ((1, (40.0, 60.0)), (2, (80.0, 100.0))):
        directory = write_run(tmp_path / f"seed{seed}", final, seed=seed, curve=CURVE)
        on_the_way = EvaluationRow(500, 30.0, 500, 0, 7, 10.0 * seed, 0.1 * seed, None)
        append_evaluations(directory / "evaluations.csv", [on_the_way])
    axes = returns_figure(comparison_of(tmp_path), scaled=True).axes[0]
    assert points(axes) == pytest.approx(np.array([(500.0, 0.15), (1000.0, 0.7)]))
    assert axes.get_ylabel() == "scaled return of 500-step episodes"
    assert {text.get_text() for text in axes.texts} == {"expert", "random"}


def test_scaled_returns_want_a_scale(tmp_path: Path) -> None:
    write_run(tmp_path / "a", levels=None, curve=CURVE)
    with pytest.raises(BootifolError, match="a has no scaled evaluations"):
        returns_figure(comparison_of(tmp_path), scaled=True)


def test_a_long_legend_leaves_the_plots_their_height(tmp_path: Path) -> None:
    write_run(tmp_path / "a", curve=CURVE)
    low = returns_figure(comparison_of(tmp_path))
    for number in range(5):
        write_run(tmp_path / f"own{number}", method=f"a_long_name_of_a_module:Method{number}", curve=CURVE)
    high = returns_figure(comparison_of(tmp_path))
    assert high.get_figheight() == pytest.approx(low.get_figheight() + 4 * 0.19)


def test_episodes_of_different_lengths_are_not_drawn_together(tmp_path: Path) -> None:
    write_run(tmp_path / "a", curve=CURVE)
    write_run(tmp_path / "b", method="virl")
    with pytest.raises(BootifolError, match="episodes differ in length"):
        returns_figure(comparison_of(tmp_path))


def test_agents_with_other_training_episodes_are_drawn_by_longer_ones_that_all_have(tmp_path: Path) -> None:
    for name, length, backbone in (("a", 60, None), ("b", 50, "google/efficientnet-b0")):
        run_dir = write_run(tmp_path / name, curve=CURVE, reward__bootifol__backbone=backbone)
        evaluations = run_dir / "evaluations.csv"
        evaluations.write_text(evaluations.read_text().replace(",60,", f",{length},"))
        append_evaluations(evaluations, [EvaluationRow(100, 6.0, 500, 0, 7, float(length), None, None)])
    axes = returns_figure(comparison_of(tmp_path)).axes[0]
    assert axes.get_ylabel() == "return of 500-step episodes"
    assert [line.get_label() for line in axes.lines] == ["BootIfOL, 1 seed", "Eff-BootIfOL, 1 seed"]
    # The mean of the final episodes, 40 and 60, comes last.
    assert points(axes, 1) == pytest.approx(np.array([(100.0, 50.0), (1000.0, 50.0)]))


def test_a_loss_may_be_the_sum_of_two(tmp_path: Path) -> None:
    write_run(tmp_path / "a", seed=1, losses={"prediction": [4.0, 3.0], "sequence": [2.0, 1.0]})
    write_run(tmp_path / "b", seed=2, losses={"prediction": [2.0, 1.0], "sequence": [2.0, 1.0]})
    loss = Loss("L_seq", ("loss/prediction", "loss/sequence"))
    axes = losses_figure(comparison_of(tmp_path), "alignment", [loss]).axes[0]
    assert points(axes) == pytest.approx(np.array([(10.0, 5.0), (20.0, 3.0)]))


def test_a_run_without_the_loss_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_dir = write_run(tmp_path / "a", method="gaifo", losses={"discriminator": [1.0, 1.0]})
    assert figures.main(["sequence-loss", str(run_dir), "--out", str(tmp_path / "figure.png")]) == 2
    told = capsys.readouterr().err
    assert f"{run_dir} has logged no loss/prediction in its Interactive Phase" in told
    assert not (tmp_path / "figure.png").exists()


LOSSES = {name: [4.0, 3.0, 2.0] for name in ("prediction", "sequence", "autoencoder", "triplet")}


@pytest.fixture
def ablations(tmp_path: Path) -> Path:
    """Runs that differ in what the paper ablates."""
    write_run(tmp_path / "runs" / "all", curve=CURVE, losses=LOSSES)
    write_run(tmp_path / "runs" / "no-alignment", curve=CURVE, alignment__gradient_steps=0)
    write_run(
        tmp_path / "runs" / "to-the-end",
        curve=CURVE,
        alignment__gradient_steps=0,
        interactive__reward_updates_until=1000,
    )
    write_run(tmp_path / "runs" / "encodings", curve=CURVE, agent__observations="encodings")
    return tmp_path / "runs"


@pytest.mark.parametrize(
    ("command", "runs", "labels"),
    [
        (
            "alignment",
            ["all", "no-alignment", "to-the-end"],
            ["alignment", "no-alignment", "no-alignment, trained to the end"],
        ),
        ("encoder-training", ["to-the-end", "no-alignment"], ["500-step", "1K-step"]),
        ("encoding-based", ["all", "encodings"], ["image-based", "encoding-based"]),
        ("returns", ["all"], ["BootIfOL"]),
        ("alignment-losses", ["all"], ["BootIfOL"]),
        ("sequence-loss", ["all"], ["BootIfOL"]),
    ],
)
def test_every_figure_is_a_command(
    command: str, runs: list[str], labels: list[str], ablations: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = []
    monkeypatch.setattr("benchmarks.figure.save_png", lambda figure, out: drawn.append(figure))
    arguments = [command, *(str(ablations / run) for run in runs), "--out", "figure.png"]
    assert figures.main(arguments) == 0
    assert [line.get_label() for line in drawn[0].axes[0].lines] == [f"{label}, 1 seed" for label in labels]


def test_a_figure_of_a_collection_is_that_of_its_runs(
    ablations: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = {name: ablations / name for name in ("all", "encodings")}
    add_to_collection(tmp_path / "kept", runs, metrics=["loss/prediction", "loss/sequence"])
    drawn = []
    monkeypatch.setattr("benchmarks.figure.save_png", lambda figure, out: drawn.append(figure))
    kept = [str(tmp_path / "kept" / name) for name in runs]
    for words in (
        ["returns", "--by-time", "--scaled"],
        ["encoding-based"],
        ["metrics", "--metrics", "loss/sequence"],
    ):
        for paths in (map(str, runs.values()), kept):
            assert figures.main([words[0], *paths, *words[1:], "--out", "figure.png"]) == 0
        for of_runs, of_collection in zip(drawn[-2].axes, drawn[-1].axes, strict=True):
            assert len(of_runs.lines) == len(of_collection.lines) > 0
            for line in range(len(of_runs.lines)):
                np.testing.assert_array_equal(points(of_runs, line), points(of_collection, line))
    assert drawn[0].axes[0].get_xlabel() == "minutes of wall-clock time"
    assert drawn[0].axes[0].get_ylabel() == "scaled return of 500-step episodes"


def test_every_figure_is_on_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    pages = "".join(page.read_text() for page in (Path(__file__).parents[2] / "docs").rglob("*.md"))
    assert [name for name in figures.FIGURES if f"benchmarks.figure {name}" not in pages] == []
    with pytest.raises(SystemExit) as stopped:
        figures.main(["reruns"])
    assert stopped.value.code == 2
    assert "Available subcommands: returns, alignment" in capsys.readouterr().err


def test_a_figure_is_written_whole(
    ablations: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "docs" / "returns.png"
    assert figures.main(["returns", str(ablations / "all"), "--out", str(out)]) == 0
    assert f"figure: {out}" in capsys.readouterr().out
    with Image.open(out) as picture:
        assert len(picture.convert("RGB").getcolors(maxcolors=1 << 22)) > 10
    assert figures.main(["returns", str(ablations / "all"), "--out", str(out.with_suffix(".bmp"))]) == 2
    assert "ends in .png" in capsys.readouterr().err
    assert [path.name for path in out.parent.iterdir()] == ["returns.png"]


def test_a_random_policy_has_no_curve(
    ablations: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    random = write_run(tmp_path / "random", method="random", agent_steps=0)
    arguments = [str(random), str(ablations / "all"), "--out", str(tmp_path / "figure.png")]
    assert figures.main(["returns", *arguments]) == 0
    assert f"{random} learns nothing, so it has no curve" in capsys.readouterr().out


def test_an_ablation_wants_two_variants_of_bootifol(
    ablations: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = [str(ablations / "all"), "--out", "figure.png"]
    assert figures.main(["alignment", *one]) == 2
    assert "all finished runs are of one variant, alignment: add one" in capsys.readouterr().err
    write_run(ablations / "cut", agent_steps=10, alignment__gradient_steps=0)
    assert figures.main(["alignment", str(ablations / "cut"), *one]) == 2
    assert "cut (no-alignment on Reacher Hard) is unfinished" in capsys.readouterr().err
    other = write_run(ablations / "other", method="virl")
    assert figures.main(["alignment", str(other), *one]) == 2
    assert "is of the method virl, but the ablation is of bootifol" in capsys.readouterr().err


def test_film_strips_begin_at_the_start_and_end_at_the_end(shared_run: Path) -> None:
    run = read_run(shared_run)
    figure = expert_above_agent([run, run], start=1)
    assert len(figure.axes) == 4
    for axes, kind in zip(figure.axes, ["expert", "agent"] * 2, strict=True):
        frames = run.showcase[kind, 1].frames
        assert np.array_equal(np.asarray(axes.images[0].get_array()), frames[0])
        assert np.array_equal(np.asarray(axes.images[-1].get_array()), frames[60])
    assert [text.get_text() for text in figure.axes[1].get_xticklabels()][:2] == ["0", "7"]
    tops = [axes.get_position().y1 for axes in figure.axes]
    assert tops == sorted(tops, reverse=True)


def test_a_run_on_a_page(shared_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = read_run(shared_run)
    curve, rewards, *strips = run_figure(run, start=1).axes
    scaled = [row.scaled_return for row in run.evaluations_of(500)[AGENT_STEPS]]
    assert np.asarray(curve.lines[0].get_ydata())[-1] == pytest.approx(np.mean(scaled))
    for axes, line, kind in zip(strips, rewards.lines, ("expert", "agent", "random"), strict=True):
        video = run.showcase[kind, 1]
        np.testing.assert_array_equal(np.asarray(axes.images[0].get_array()), video.frames[3])
        np.testing.assert_array_equal(np.asarray(line.get_ydata()), video.rewards)
    out = tmp_path / "docs" / "run.png"
    assert figures.main(["run", str(shared_run), "--out", str(out)]) == 0
    with Image.open(out) as picture:
        assert picture.width == 1560
    two = [str(shared_run), str(write_run(tmp_path / "a")), "--out", str(out)]
    assert figures.main(["run", *two]) == 2
    assert "the figure shows one run, and there are 2" in capsys.readouterr().err
    assert figures.main(["run", *two[1:]]) == 2
    assert "a has no films from start 0 to draw" in capsys.readouterr().err


def test_a_run_without_films_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_dir = write_run(tmp_path / "a")
    assert figures.main(["demonstrations", str(run_dir), "--out", str(tmp_path / "figure.png")]) == 2
    assert f"{run_dir} has no film of expert and agent from start 0" in capsys.readouterr().err


def test_any_metric_has_a_panel_and_every_run_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_run(tmp_path / "a", seed=1, curve=CURVE, losses={"total": [3.0, 2.0]})
    write_run(tmp_path / "b", seed=2, curve=CURVE, losses={"total": [5.0, 1.0], "extra": [1.0]})
    runs = [read_run(tmp_path / name) for name in "ab"]
    figure, notes = figures.metrics_figure(runs, ["loss/total", "loss/extra"])
    assert notes == [f"{tmp_path / 'a'} has not logged loss/extra"]
    _, total, extra = figure.axes
    assert [points(total, line)[:, 1].tolist() for line in range(2)] == [[3.0, 2.0], [5.0, 1.0]]
    assert len(extra.lines) == 1
    words = [str(tmp_path), "--metrics", "loss/none", "--out", str(tmp_path / "x.png")]
    assert figures.main(["metrics", *words]) == 2
    assert "no run has logged loss/none; choose of" in capsys.readouterr().err
