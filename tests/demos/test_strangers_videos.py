"""Videos that hang, fill the disk or trip over their names: bounded, and told in a sentence."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bootifol.cli.main import main
from bootifol.demos import import_videos
from bootifol.demos.demo_set import DemoSet
from bootifol.errors import BootifolError
from bootifol.video_files import folders_and_arrays
from bootifol.video_files.lerobot_reading import _is_harmless
from bootifol.video_files.orientation import TimedFrame
from bootifol.video_files.picture_order import natural_order
from bootifol.video_files.reading import stream_video

FRAME = np.zeros((8, 8, 3), np.uint8)


def a_folder(path: Path, pictures: int = 3) -> Path:
    path.mkdir()
    for index in range(pictures):
        Image.fromarray(np.full((8, 8, 3), 40 * index, np.uint8)).save(path / f"{index}.png")
    return path


def test_a_picture_that_shows_for_days_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    times = [0.0, 0.04, 23 * 86400.0]
    monkeypatch.setattr(import_videos, "_stream", lambda _: (TimedFrame(FRAME, time) for time in times))
    conversion = import_videos.Conversion(frames=5, size=8, frames_per_second=25)
    with pytest.raises(BootifolError, match=r"one.mp4 shows one picture for 1,987,200 s, 25 times a second"):
        list(import_videos.convert(Path("one.mp4"), conversion))


def test_an_archive_that_unfolds_to_gigabytes_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(folders_and_arrays, "LARGEST_UNFOLDED", 1_000_000)
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, video=np.zeros((2000, 16, 16, 3), np.uint8))
    with pytest.raises(BootifolError, match=r"unfolds from [\d,]+ bytes to 1,536,000"):
        next(stream_video(path))


def test_a_pipe_among_pictures_is_refused(tmp_path: Path) -> None:
    folder = a_folder(tmp_path / "video")
    os.mkfifo(folder / "1a.png")
    with pytest.raises(BootifolError, match=r"1a.png is no file"):
        list(stream_video(folder))


def test_names_with_signs_that_are_no_digits_are_sorted() -> None:
    names = ["²", "10", "2", "٣", "a²b"]
    assert [path.name for path in sorted(map(Path, names), key=natural_order)][:2] == ["2", "٣"]


def test_what_a_killed_import_left_is_gone_after_the_next(tmp_path: Path) -> None:
    folder, out = a_folder(tmp_path / "video"), tmp_path / "demos"
    leftover = out / ".expert.0123abcd.tmp"
    leftover.mkdir(parents=True)
    (leftover / "shard-00000.npy").write_bytes(b"half")
    (out / ".mine.0123abcd.tmp").touch()
    words = ["demos", "import", str(folder), "--out", str(out), "--frames", "3", "--size", "8"]
    assert main(words) == 0
    assert {path.name for path in out.iterdir()} == {"expert", ".mine.0123abcd.tmp"}


def test_two_imports_to_one_place_leave_the_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, out = a_folder(tmp_path / "video"), tmp_path / "demos" / "expert"
    conversion = import_videos.Conversion(frames=3, size=8)
    write, said = import_videos._write_set, []

    def write_and_another_comes(*arguments: object) -> None:
        with pytest.raises(BootifolError, match="another process is writing to") as refused:
            import_videos.import_videos([folder], out, conversion)
        said.append(str(refused.value))
        write(*arguments)

    monkeypatch.setattr(import_videos, "_write_set", write_and_another_comes)
    import_videos.import_videos([folder], out, conversion)
    assert said and len(DemoSet.open(out, verify=True)) == 1


@pytest.mark.parametrize(
    ("template", "harmless"),
    [
        ("videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4", True),
        ("{chunk_index:999999999d}.mp4", False),
        ("{chunk_index:>999999999}.mp4", False),
        ("{video_key.__class__.__mro__}", False),
        ("{video_key[0]}", False),
        ("{:d}", False),
        ("x" * 2000, False),
    ],
)
def test_a_template_of_a_lerobot_dataset_has_plain_fields(template: str, harmless: bool) -> None:
    assert _is_harmless(template) == harmless


@pytest.mark.parametrize(
    "words",
    [
        ["demos", "record", "--task", "drawn_home", "--workers", "100000"],
        ["demos", "record", "--task", "drawn_home", "--seed", "9" * 30],
        ["demos", "record", "--task", "drawn_home", "--episodes", "9" * 12],
        ["demos", "record", "--task", "drawn_home", "--video-size", "1000000000"],
        ["demos", "record", "--task", "drawn_home", "--episode-steps", "1000000000000"],
        ["demos", "import", "[/x]", "--size", "1000000000"],
        ["demos", "import", "[/x]", "--fps", "1e300"],
        ["demos", "import", "[/x]"],
        ["train", "--demos", "[/x]"],
        ["train", "--demos", "x", "--task", "drawn_home", "--threads", "100000000000"],
        ["train", "--demos", "x", "--task", "drawn_home", "--seed", "9" * 30],
        ["train", "--demos", "x", "--task", "drawn_home", "--agent.hidden-dim", "9" * 30],
        ["train", "--demos", "x", "--task", "drawn_home", "--reward.virl.learning-rate", "1e300"],
        ["train", "--demos", "x", "--task", "drawn_home", "--evaluation-steps", "1000000000000"],
    ],
)
def test_numbers_beyond_all_use_are_refused_before_anything_is_made(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*words, "--out", str(tmp_path / "o[/x]")]) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("error: ")
    assert not list(tmp_path.iterdir())


def test_a_manifest_with_a_changed_bit_is_found_on_verifying(tmp_path: Path) -> None:
    folder, out = a_folder(tmp_path / "video"), tmp_path / "demos" / "expert"
    import_videos.import_videos([folder], out, import_videos.Conversion(frames=3, size=8))
    path = out / "manifest.json"
    path.write_text(path.read_text().replace('"behavior": "expert"', '"behavior": "expelt"'))
    DemoSet.open(out)
    with pytest.raises(BootifolError, match=r"manifest is damaged or incomplete: .*manifest.json"):
        DemoSet.open(out, verify=True)
    value = json.loads(path.read_text())
    del value["checksum"]
    path.write_text(json.dumps(value))
    DemoSet.open(out, verify=True)
