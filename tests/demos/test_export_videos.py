import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from small_demo_sets import WriteSet
from tests.video_files.whole_videos import read_video

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.export_videos import Format, export_videos
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.demos.manifest import read_manifest, write_manifest
from bootifol.errors import BootifolError
from bootifol.video_files.reading import frame_rate, video_paths

MEAN_ERROR = {"mp4": 2.0, "lerobot": 0.6}
"""Bounds in levels of 255 for smooth pictures; 1.3 and 0.4 were measured."""


def smooth_videos(count: int) -> np.ndarray:
    """Colored slopes that move, each video another color: uint8 `[count, 5, 8, 8, 3]`."""
    time, row, column = np.indices((5, 8, 8))
    slopes = np.stack([30 + 20 * row + 5 * time, 20 * column + 30, 200 - 10 * row - 10 * time], -1)
    return np.stack([np.roll(slopes, shift, axis=-1) for shift in range(count)]).astype(np.uint8)


def shortened(directory: Path, video: int, length: int) -> Path:
    """The set with one video that ended early."""
    manifest = read_manifest(directory)
    videos = list(manifest.videos)
    videos[video] = dataclasses.replace(videos[video], length=length)
    write_manifest(directory, dataclasses.replace(manifest, videos=tuple(videos)))
    return directory


def imported(exported: Path, out: Path) -> DemoSet:
    return import_videos(video_paths([exported]), out, Conversion(frames=5, size=8))


def test_arrays_come_back_bit_for_bit(write_set: WriteSet, tmp_path: Path) -> None:
    videos = smooth_videos(3)
    videos[1, 3:] = videos[1, 2]  # stands still from frame 3 on: it ended there
    demos = shortened(write_set(videos), 1, 3)
    assert export_videos(demos, tmp_path / "out", "npy") == 3
    assert np.load(tmp_path / "out" / "drawn-expert-000001.npy").shape == (3, 8, 8, 3)
    back = imported(tmp_path / "out", tmp_path / "back")
    np.testing.assert_array_equal(back.gather(range(3)), videos)
    assert [video.length for video in back.manifest.videos] == [5, 3, 5]


@pytest.mark.parametrize("format", ["mp4", "lerobot"])
@pytest.mark.parametrize("rate", [25.0, 12.5, 29.97])
def test_videos_come_back_within_a_tolerance(
    write_set: WriteSet, tmp_path: Path, format: Format, rate: float
) -> None:
    if format == "lerobot":
        pytest.importorskip("pyarrow")
    videos = smooth_videos(3)
    videos[1, 3:] = videos[1, 2]
    demos = shortened(write_set(videos, frames_per_second=rate), 1, 3)
    assert export_videos(demos, tmp_path / "out", format) == 3
    back = imported(tmp_path / "out", tmp_path / "back")
    assert [video.length for video in back.manifest.videos] == [5, 3, 5]
    assert back.manifest.frames_per_second == pytest.approx(rate)
    for index in range(3):
        error = np.abs(back[index].frames.astype(int) - videos[index]).mean()
        assert error < MEAN_ERROR[format], f"video {index} differs by {error}"


def test_only_the_first_videos_are_exported(write_set: WriteSet, tmp_path: Path) -> None:
    demos = write_set(smooth_videos(3))
    assert export_videos(demos, tmp_path / "out", "mp4", videos=2) == 2
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "drawn-expert-000000.mp4",
        "drawn-expert-000001.mp4",
    ]
    assert read_video(tmp_path / "out" / "drawn-expert-000000.mp4").shape == (5, 256, 256, 3)
    assert export_videos(demos, tmp_path / "more", "npy", videos=9) == 3


def test_an_unknown_frame_rate_must_be_given(write_set: WriteSet, tmp_path: Path) -> None:
    demos = write_set(smooth_videos(1), frames_per_second=None)
    for format in ("mp4", "lerobot"):
        with pytest.raises(BootifolError, match=r"does not say how fast its videos play .* give --fps"):
            export_videos(demos, tmp_path / "out", format)  # type: ignore[arg-type]
    export_videos(demos, tmp_path / "out", "mp4", frames_per_second=20)
    assert frame_rate(tmp_path / "out" / "drawn-expert-000000.mp4") == 20
    export_videos(demos, tmp_path / "arrays", "npy")


def test_a_behavior_is_chosen(write_set: WriteSet, tmp_path: Path) -> None:
    write_set(smooth_videos(1), name="a")
    write_set(smooth_videos(2), name="b", behavior="random")
    assert export_videos(tmp_path, tmp_path / "out", "npy", behavior="random") == 2
    with pytest.raises(BootifolError, match="no half_good videos: choose among --behavior expert, random"):
        export_videos(tmp_path, tmp_path / "other", "npy", behavior="half_good")


def test_errors_write_nothing(write_set: WriteSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    demos = write_set(smooth_videos(3))
    out = tmp_path / "out"
    with pytest.raises(BootifolError, match="at least 1 video"):
        export_videos(demos, out, "npy", videos=0)
    with pytest.raises(BootifolError, match="frames per second must be between"):
        export_videos(demos, out, "mp4", frames_per_second=float("nan"))
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "pyarrow.parquet", None)
        with pytest.raises(BootifolError, match="pip install pyarrow"):
            export_videos(demos, out, "lerobot")
    shard = demos / "shard-00000.npy"
    data = bytearray(shard.read_bytes())
    data[-1] ^= 1  # in the last video of the shard
    shard.write_bytes(data)
    with pytest.raises(BootifolError, match="the pixels of drawn-expert-000002 are not the ones recorded"):
        export_videos(demos, out, "npy")
    assert [path for path in tmp_path.iterdir() if path != demos] == []
    out.mkdir()
    with pytest.raises(BootifolError, match="exists already"):
        export_videos(demos, out, "npy")


def test_a_name_that_leads_elsewhere_is_refused(write_set: WriteSet, tmp_path: Path) -> None:
    demos = write_set(smooth_videos(1))
    manifest = json.loads((demos / "manifest.json").read_text())
    manifest["videos"][0]["name"] = "../outside"
    (demos / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(BootifolError, match="is no file name"):
        export_videos(demos, tmp_path / "out", "npy")
    assert not (tmp_path / "outside.npy").exists()


def test_a_video_longer_than_its_set_is_refused(write_set: WriteSet, tmp_path: Path) -> None:
    demos = shortened(write_set(smooth_videos(1)), 0, 6)
    with pytest.raises(BootifolError, match="drawn-expert-000000 has 6 of 5 frames"):
        export_videos(demos, tmp_path / "out", "npy")


def test_an_interrupted_export_leaves_nothing(
    write_set: WriteSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demos = write_set(smooth_videos(2))

    def interrupted(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("bootifol.demos.export_videos.write_video", interrupted)
    with pytest.raises(KeyboardInterrupt):
        export_videos(demos, tmp_path / "out", "mp4")
    assert list(tmp_path.iterdir()) == [demos]
