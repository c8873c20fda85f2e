"""How cost grows: what is timed, that it is gone on with, and the figure. Times are not asserted."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.engine import Work
from PIL import Image

from benchmarks import scaling
from bootifol.demos.demo_set import DemoSet
from bootifol.errors import BootifolError
from bootifol.presets import SMOKE
from bootifol.training.config import TrainingConfig


def times(panel: str, stage: str, by_size: dict[int, float]) -> list[dict[str, str]]:
    return [scaling.row(("cpu", 1, panel, size, stage), [ms]) for size, ms in by_size.items()]


def test_only_what_is_missing_is_timed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worked: list[tuple[int, str]] = []

    def works(_: TrainingConfig, size: int, directory: Path) -> dict[str, scaling.Prepare]:
        assert not list(directory.iterdir())

        def prepared(stage: str) -> Work:
            return lambda: worked.append((size, stage))

        small = {"quick": lambda: prepared("quick")}
        return small if size > 10 else {**small, "slow": lambda: prepared("slow")}

    monkeypatch.setattr(scaling, "PANELS", {"batch": scaling.Panel("transitions", (10, 20), works)})
    monkeypatch.setattr(scaling, "MOST_RUNS", 2)
    out, picture = tmp_path / "scaling.csv", tmp_path / "new" / "scaling.png"
    words = ["--panels", "batch", "--runs", "2", "--threads", "1", "--out", str(out)]
    words += ["--scratch", str(tmp_path)]
    assert scaling.main(words) == 0
    assert set(worked) == {(10, "quick"), (10, "slow"), (20, "quick")}
    assert len(worked) == 3 * (1 + 2)  # one run that is not counted, two that are
    whole = out.read_text().splitlines()
    out.write_text("\n".join(line for line in whole if "slow" not in line))
    worked.clear()
    monkeypatch.setattr(scaling, "drawn", lambda rows: scaling.Figure())
    assert scaling.main([*words, "--picture", str(picture)]) == 0
    assert set(worked) == {(10, "slow")} and picture.exists()


def test_a_demo_set_of_random_pixels_is_whole(tmp_path: Path) -> None:
    written = DemoSet.open(scaling.write_random_set(tmp_path, 5, 8), verify=True)
    assert len(written) == 5 and written[4].frames.shape == (scaling.FRAMES, 8, 8, 3)
    assert (written[0].frames != written[4].frames).any()


def test_a_full_disk_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match=r"videos take .* GB and .* choose another --scratch"):
        scaling.write_random_set(tmp_path, 10**9, 64)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("size", "read"), [(32, True), (48, False), (64, True), (84, False), (128, False)])
def test_only_sizes_that_the_reward_reads_are_timed_with_it(tmp_path: Path, size: int, read: bool) -> None:
    stages = scaling.PANELS["picture"].works(SMOKE, size, tmp_path)
    assert ("alignment step" in stages) == read and ("label an episode" in stages) == read
    assert "sample and RL update" in stages


@pytest.mark.parametrize("panel", scaling.PANELS.values(), ids=list(scaling.PANELS))
def test_linear_growth_has_slope_one(panel: scaling.Panel) -> None:
    linear = {size: 3.0 * panel.amount(size) for size in panel.sizes}
    assert scaling.last_slope(panel, linear) == pytest.approx(1.0)
    assert scaling.last_slope(panel, dict.fromkeys(panel.sizes, 3.0)) == pytest.approx(0.0)
    assert scaling.last_slope(panel, {panel.sizes[0]: 3.0}) is None


def test_tables_and_figure_show_every_curve(tmp_path: Path) -> None:
    rows = times("picture", "alignment step", {64: 8.0, 32: 2.0})
    rows += times("batch", "sample and RL update", {32: 5.0, 64: 7.5, 512: 60.0})
    picture, batch = scaling.tables(rows)
    assert picture.splitlines()[0].startswith("| ms by pixels of a picture | 32² | 48² |")
    assert picture.splitlines()[2] == "| alignment step | 2 |  | 8 |  |  | 1.00 |"
    assert batch.splitlines()[2] == "| sample and RL update | 5 | 7.5 |  |  | 60 | 1.00 |"
    figure = scaling.drawn(rows)
    lines = {axes.get_xlabel(): axes.get_lines() for axes in figure.axes}
    assert list(lines["pixels of a picture"][0].get_xdata()) == [1024, 4096]
    assert [len(found) for found in lines.values()] == [0, 2, 0, 2]  # each with its line of slope 1
    with Image.open(scaling.save_png(figure, tmp_path / "scaling.png")) as picture_file:
        assert picture_file.width > 1000


def test_another_table_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scaling.csv").write_text("task,seconds\n")
    assert scaling.main(["--out", str(tmp_path / "scaling.csv")]) == 2
    assert "is another table" in capsys.readouterr().err
