from pathlib import Path

import numpy as np
import pytest
import tyro

from bootifol.cli import demos
from bootifol.cli.main import main
from bootifol.demos import record as recording
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import Manifest, find_demo_sets
from bootifol.errors import BootifolError
from bootifol.video_files.writing import write_video


def record(out: Path, *more: str) -> int:
    arguments = ["--task", "drawn_reach", "--episodes", "3", "--out", str(out), "--agent-size", "16"]
    return tyro.cli(demos.record, args=[*arguments, "--video-size", "16", *more])


def test_record_writes_one_set_a_behavior_and_check_approves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert record(tmp_path / "demos") == 0
    sets = find_demo_sets(tmp_path / "demos")
    assert sets == {name: tmp_path / "demos" / name for name in ("expert", "random", "half_good")}
    assert {len(DemoSet.open(path)) for path in sets.values()} == {3}
    assert tyro.cli(demos.check, args=[str(tmp_path / "demos"), "--task", "drawn_reach"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("every checksum agrees") == 3
    assert printed.count("fits the task drawn_reach") == 3
    assert "3 videos of 31 frames" in printed
    train = f"train --task drawn_reach --preset drawn --demos {tmp_path / 'demos'} --out runs/drawn_reach"
    assert f"then bootifol {train} --pictures.video-size 16 --pictures.agent-size 16\n" in printed


def test_check_of_another_task_says_what_to_do_and_exits_with_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(tmp_path / "demos", "--behaviors", "random")
    assert tyro.cli(demos.check, args=[str(tmp_path / "demos"), "--task", "reacher_hard"]) == 1
    assert "the videos show the task drawn_reach" in capsys.readouterr().out


def test_half_good_videos_are_few(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, "HALF_GOOD_VIDEOS", 2)
    record(tmp_path / "demos", "--behaviors", "half_good", "random")
    assert len(DemoSet.open(tmp_path / "demos" / "half_good")) == 2
    assert len(DemoSet.open(tmp_path / "demos" / "random")) == 3


def test_ctrl_c_says_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(plan: object, index: int) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(recording, "play", interrupted)
        assert record(tmp_path / "demos") == 130
    assert "run the same command again" in capsys.readouterr().out
    assert record(tmp_path / "demos") == 0


@pytest.mark.filterwarnings("ignore::bootifol.errors.BootifolWarning")
def test_import_takes_a_folder_of_videos(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "films"
    folder.mkdir()
    for number in (2, 10, 1):
        np.save(folder / f"film{number}.npy", np.full((7, 20, 30, 3), number, np.uint8))
    (folder / "notes.txt").write_text("not a video")
    out = tmp_path / "demos"
    assert (
        tyro.cli(demos.import_, args=[str(folder), "--out", str(out), "--frames", "9", "--size", "16"]) == 0
    )
    demo_set = DemoSet.open(out / "expert")
    assert [int(demo_set[i].frames[0, 0, 0, 0]) for i in range(3)] == [1, 2, 10]
    printed = capsys.readouterr().out
    assert "3 videos of 9 frames, 16×16 pixels, from 3 files" in printed
    assert "3 shorter than 9 frames: they stand still on their last picture; --frames 7 would" in printed
    assert f"next: bootifol demos check {out}  (" in printed
    assert tyro.cli(demos.check, args=[str(out), "--task", "drawn_reach"]) == 1
    printed = capsys.readouterr().out
    assert "import them again with --frames 31" in printed
    assert "nothing moves in demos-expert-000000" in printed


def test_import_for_a_task_takes_its_pace_and_length(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frames = np.random.default_rng(1).integers(0, 255, (61, 16, 16, 3), np.uint8)
    write_video(tmp_path / "film.mp4", frames, 20.0)

    def imported(out: str, *more: str) -> Manifest:
        words = [str(tmp_path / "film.mp4"), "--out", str(tmp_path / out), "--size", "16", *more]
        assert main(["demos", "import", *words]) == 0
        return DemoSet.open(tmp_path / out / "expert").manifest

    found = imported("a", "--task", "drawn_home")
    assert (found.frames, found.frames_per_second, len(found.videos)) == (31, 10.0, 1)
    printed = capsys.readouterr().out
    assert (
        f"check {tmp_path / 'a'} --task drawn_home, then bootifol train --task drawn_home --preset" in printed
    )
    found = imported("b", "--task", "drawn_home", "--action-repeat", "2")
    assert (found.frames, found.frames_per_second) == (16, 5.0)
    assert "--action-repeat 2, then" in capsys.readouterr().out
    found = imported("c", "--task", "drawn_home", "--frames", "9", "--fps", "20")
    assert (found.frames, found.frames_per_second) == (9, 20.0), "what is given goes before"
    found = imported("d")
    assert (found.frames, found.frames_per_second) == (61, 20.0)


def test_a_task_without_a_rate_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "envs")
    np.save(tmp_path / "film.npy", np.zeros((9, 20, 20, 3), np.uint8))
    words = ["demos", "import", str(tmp_path / "film.npy"), "--out", str(tmp_path / "out"), "--size", "16"]
    assert main([*words, "--task", "tiny_environments:make_without_time"]) == 0
    told = capsys.readouterr()
    assert "note: tiny_environments:make_without_time does not say how many pictures a second" in told.err
    assert (
        "1 shorter than 201 frames, as long as an episode of tiny_environments:make_without_time" in told.out
    )
    assert "--frames 9 would leave none standing" in told.out


def test_import_refuses_what_a_task_cannot_tell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save(tmp_path / "film.npy", np.zeros((9, 20, 20, 3), np.uint8))
    words = ["demos", "import", str(tmp_path / "film.npy"), "--out", str(tmp_path / "out")]
    assert main([*words, "--action-repeat", "2"]) == 2
    assert "say of which with --task" in capsys.readouterr().err
    assert main([*words, "--task", "drawn_home"]) == 2
    assert "import it without --fps, and with --frames instead of --task" in capsys.readouterr().err
    assert not (tmp_path / "out" / "expert").exists()


def test_export_writes_what_import_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(tmp_path / "demos", "--behaviors", "random")
    out, back = tmp_path / "out", tmp_path / "back"
    arguments = [str(tmp_path / "demos"), "--out", str(out), "--format", "npy", "--behavior", "random"]
    assert tyro.cli(demos.export, args=[*arguments, "--videos", "2"]) == 0
    assert f"{out}: 2 videos as npy" in capsys.readouterr().out
    assert tyro.cli(demos.import_, args=[str(out), "--out", str(back), "--frames", "31", "--size", "16"]) == 0
    recorded = DemoSet.open(tmp_path / "demos" / "random").gather([0, 1])
    np.testing.assert_array_equal(DemoSet.open(back / "expert").gather([0, 1]), recorded)
    with pytest.raises(BootifolError, match="no expert videos: choose among --behavior random"):
        demos.export(tmp_path / "demos", tmp_path / "other")


def test_wrong_places_give_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match="there is no demo set at"):
        demos.check(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BootifolError, match="empty holds no videos"):
        demos.import_([tmp_path / "empty"], tmp_path / "out")
    with pytest.raises(BootifolError, match="no task 'reacher'"):
        demos.record("reacher", tmp_path / "out")
