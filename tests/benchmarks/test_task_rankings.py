from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.rows import read_rows
from benchmarks.task_rankings import COLUMNS, VIDEO_COLUMNS, main
from PIL import Image

from benchmarks import task_rankings
from bootifol.demos.demo_set import DemoSet
from bootifol.tasks import TASKS


def words(directory: Path, *more: str) -> list[str]:
    small = ["--preset", "drawn_pixels", "--videos", "16", "--held-out", "4", "--gradient-steps", "2"]
    places = ["--demos", str(directory / "demos"), "--out", str(directory / "rankings.csv")]
    return ["--tasks", "drawn_home", *small, *places, *more]


@pytest.fixture(scope="module")
def ranked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("rankings")
    main(words(directory, "--picture", str(directory / "rankings.png")))
    return directory


def test_every_held_out_video_is_rewarded_and_the_table_has_its_intervals(ranked: Path) -> None:
    videos = read_rows(ranked / "rankings_videos.csv", VIDEO_COLUMNS)
    assert [row["kind"] for row in videos] == ["expert"] * 4 + ["half_good"] * 4 + ["random"] * 4
    [row] = read_rows(ranked / "rankings.csv", COLUMNS)
    assert (row["task"], row["gradient_steps"], row["training_videos"]) == ("drawn_home", "2", "16")
    for measure in task_rankings.MEASURES:
        low, value, high = (float(row[f"{measure}{end}"]) for end in ("_low", "", "_high"))
        assert low <= value + 1e-9
        assert value <= high + 1e-9
    with Image.open(ranked / "rankings.png") as picture:
        assert picture.width > picture.height > 100


def test_no_held_out_video_begins_like_one_of_training(ranked: Path) -> None:
    sets = {
        part: DemoSet.open(ranked / "demos" / "drawn_home" / part / "expert")
        for part in ("training", "held_out")
    }
    seeds = {part: {entry.source["seed"] for entry in demos.manifest.videos} for part, demos in sets.items()}
    assert (len(seeds["training"]), len(seeds["held_out"])) == (16, 4)
    assert not seeds["training"] & seeds["held_out"]


def test_a_ranked_task_is_not_ranked_again_unless_the_settings_differ(
    ranked: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []
    alone = task_rankings.ranked
    monkeypatch.setattr(task_rankings, "ranked", lambda *given: asked.append(given[1]) or alone(*given))
    main(words(ranked))
    assert not asked
    assert "| `drawn_home` |" in capsys.readouterr().out
    main([*words(ranked), "--gradient-steps", "1"])
    assert [setup.gradient_steps for setup in asked] == [1]
    videos = ranked / "rankings_videos.csv"
    assert len(read_rows(videos, VIDEO_COLUMNS)) == 12
    videos.unlink()
    main([*words(ranked), "--gradient-steps", "1"])
    assert len(asked) == 2 and len(read_rows(videos, VIDEO_COLUMNS)) == 12


def test_a_task_without_an_expert_is_left_out_with_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(TASKS, "drawn_home", replace(TASKS["drawn_home"], has_expert=False))
    main(words(tmp_path))
    assert "drawn_home is left out: no expert is bundled yet" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("count", "sentence"), [("1", "at least 2"), ("65", "--held-out is at most 64")])
def test_too_few_and_too_many_videos_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], count: str, sentence: str
) -> None:
    assert main(words(tmp_path, "--held-out", count)) == 2
    assert sentence in capsys.readouterr().err
