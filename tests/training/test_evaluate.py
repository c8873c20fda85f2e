"""`bootifol evaluate`: what it prints and writes, and what bad input gets."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
from tests.video_files.whole_videos import read_video

from bootifol import api
from bootifol.cli.main import main
from bootifol.video_files.reading import frame_rate


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")


def table(path: str) -> list[dict[str, str]]:
    return list(csv.DictReader(Path(path).read_text().splitlines()))


def test_one_run_is_told_written_and_filmed(finished: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = api.evaluate(finished, episodes=3)
    command = ["evaluate", str(finished), "--episodes", "3", "--out", "made/played.csv", "--videos", "films"]
    assert main(command) == 0
    said = capsys.readouterr().out
    for number, episode in enumerate(result.episodes):
        solved = ", solved" if episode.success else ""
        assert f"episode {number}: return {episode.environment_return:.1f}{solved}\n" in said
    assert f"solved {result.solved} of 3" in said
    rows = table("made/played.csv")
    assert [float(row["environment_return"]) for row in rows] == [
        episode.environment_return for episode in result.episodes
    ]
    assert [row["success"] for row in rows] == [str(episode.success) for episode in result.episodes]
    assert {(row["run"], row["agent_steps"], row["episode_steps"]) for row in rows} == {
        (str(finished), "90", "60")
    }
    assert sorted(path.name for path in Path("films").iterdir()) == [
        f"episode-{number}.mp4" for number in range(3)
    ]
    film = Path("films/episode-0.mp4")
    assert (len(read_video(film)), frame_rate(film)) == (61, 10.0)
    assert main(["evaluate", str(finished), "--episodes", "1", "--out", "made/played.csv"]) == 0
    assert len(Path("made/played.csv").read_text().splitlines()) == 2, "an older file is replaced"


def test_several_runs_get_a_line_each_in_their_order(
    finished: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(finished, "other[1]")
    runs = ["other[1]", str(finished)]
    assert main(["evaluate", *runs, "--episodes", "2", "--out", "played.csv", "--videos", "films"]) == 0
    result = api.evaluate(finished, episodes=2)
    assert result.scaled_return is not None
    told = (
        f"mean return {result.summary.mean:.1f}, scaled return {result.scaled_return:.3f}, "
        f"solved {result.solved} of 2"
    )
    lines = capsys.readouterr().out.splitlines()
    assert lines[-4:] == [
        *(f"{run}: {told}" for run in runs),
        "every episode: played.csv",
        "videos: films",
    ]
    assert [row["run"] for row in table("played.csv")] == [run for run in runs for _ in range(2)]
    assert {str(path.relative_to("films")) for path in Path("films").rglob("*.mp4")} == {
        f"{name}/episode-{number}.mp4" for name in ("other[1]", "run") for number in range(2)
    }


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "there are no runs to evaluate"),
        (["RUN", "nowhere"], "nowhere is not a run"),
        (["RUN", "--episodes", "0"], "ask for one at least"),
        (["RUN", "--out", "."], "--out . is a directory: name a file, such as episodes.csv"),
        (["RUN", "--videos", "file"], "--videos file is a file: name a directory"),
        (["RUN", "RUN", "--videos", "films"], "the videos of two runs named run would go to films/run"),
    ],
)
def test_bad_input_gets_a_sentence_before_anything_is_played(
    finished: Path, arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("file").touch()
    assert main(["evaluate", *(str(finished) if word == "RUN" else word for word in arguments)]) == 2
    printed = capsys.readouterr()
    assert sentence in " ".join(printed.err.split())
    assert printed.out == ""
    assert [path.name for path in Path().iterdir()] == ["file"]
