from pathlib import Path

import av
import numpy as np
import pytest

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.import_videos import Conversion, centered_square, convert, import_videos
from bootifol.errors import BootifolError


def numbered(count: int, height: int = 8, width: int = 8) -> np.ndarray:
    """Frame t is gray level t."""
    return np.broadcast_to(
        np.arange(count, dtype=np.uint8)[:, None, None, None], (count, height, width, 3)
    ).copy()


def saved(path: Path, frames: np.ndarray) -> Path:
    np.save(path, frames)
    return path


def lossless(path: Path, frames: np.ndarray, rate: int) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264rgb", rate=rate, options={"crf": "0"})
        stream.height, stream.width = frames.shape[1:3]
        stream.pix_fmt = "rgb24"
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def levels(frames: np.ndarray) -> list[int]:
    return [int(level) for level in frames[:, 0, 0, 0]]


def test_a_long_file_becomes_one_video_after_another(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npy", numbered(17))
    windows = list(convert(path, Conversion(frames=5, size=8)))
    assert [levels(window) for window in windows] == [[0, 1, 2, 3, 4], [5, 6, 7, 8, 9], [10, 11, 12, 13, 14]]
    first = list(convert(path, Conversion(frames=5, size=8, windows="first")))
    assert [levels(window) for window in first] == [[0, 1, 2, 3, 4]]


def test_a_short_file_stands_still_on_its_last_picture(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npy", numbered(3))
    demo_set = import_videos([path], tmp_path / "mine" / "expert", Conversion(frames=6, size=8))
    assert levels(demo_set[0].frames) == [0, 1, 2, 2, 2, 2]
    assert demo_set.manifest.videos[0].length == 3


@pytest.mark.parametrize(
    ("rate", "wanted", "expected"),
    [
        (10, None, list(range(12))),
        (10, 10.0, list(range(12))),
        (10, 5.0, [0, 2, 4, 6, 8, 10]),
        (10, 20.0, [t // 2 for t in range(24)]),
        (30, 20.0, [0, 1, 3, 4, 6, 7, 9, 10]),
    ],
)
def test_resampling_takes_the_picture_showing_at_each_instant(
    tmp_path: Path, rate: int, wanted: float | None, expected: list[int]
) -> None:
    path = lossless(tmp_path / "a.mp4", numbered(12, 16, 16), rate)
    conversion = Conversion(frames=len(expected), size=16, frames_per_second=wanted)
    windows = list(convert(path, conversion))
    assert [levels(window) for window in windows] == [expected]


def test_the_centered_square_is_cut_out_and_averaged() -> None:
    wide = np.zeros((4, 10, 3), np.uint8)
    wide[:, 3:7] = 200
    assert (centered_square(wide, 4) == 200).all()
    tall = np.transpose(wide, (1, 0, 2))
    assert (centered_square(tall, 2) == 200).all()
    checkered = np.indices((4, 4)).sum(0) % 2 * np.uint8(200)
    np.testing.assert_array_equal(centered_square(np.stack([checkered] * 3, -1).astype(np.uint8), 2), 100)


def test_an_imported_set_states_how_it_was_made(tmp_path: Path) -> None:
    files = [
        lossless(tmp_path / "one.mp4", numbered(12, 16, 16), 10),
        lossless(tmp_path / "two.mp4", numbered(6, 16, 32), 10),
    ]
    demo_set = import_videos(files, tmp_path / "mine" / "expert", Conversion(frames=6, size=8))
    demo_set.verify()
    manifest = demo_set.manifest
    assert [video.name for video in manifest.videos] == [f"mine-expert-00000{i}" for i in range(3)]
    assert [video.source for video in manifest.videos] == [
        {"file": "one.mp4", "first_frame": 0},
        {"file": "one.mp4", "first_frame": 6},
        {"file": "two.mp4", "first_frame": 0},
    ]
    assert (manifest.task, manifest.frames_per_second, manifest.episodes) == (None, 10, 3)
    assert manifest.conversion == {
        "frames": 6,
        "size": 8,
        "frames_per_second": None,
        "windows": "all",
        "crop": "largest centered square",
    }
    assert (tmp_path / "mine" / "expert" / "contact_sheet.png").stat().st_size > 0
    assert levels(DemoSet.open(tmp_path / "mine" / "expert")[1].frames) == [6, 7, 8, 9, 10, 11]


def test_the_square_that_was_chosen_is_cut_out(tmp_path: Path) -> None:
    frames = np.random.default_rng(0).integers(0, 256, (4, 12, 20, 3), np.uint8)
    path = saved(tmp_path / "a.npy", frames)
    conversion = Conversion(frames=4, size=8, crop=(9, 3, 8))
    demo_set = import_videos([path], tmp_path / "mine" / "expert", conversion)
    np.testing.assert_array_equal(demo_set[0].frames, frames[:, 3:11, 9:17])
    assert demo_set.manifest.conversion is not None
    assert demo_set.manifest.conversion["crop"] == [9, 3, 8]
    with pytest.raises(BootifolError, match=r"a\.npy: a crop of 8×8 pixels at 13, 3 .* have 20×12"):
        import_videos([path], tmp_path / "other" / "expert", Conversion(frames=4, size=8, crop=(13, 3, 8)))
    assert not (tmp_path / "other").exists()


def test_every_bad_file_is_named_and_nothing_is_written(tmp_path: Path) -> None:
    good = saved(tmp_path / "good.npy", numbered(8))
    empty = tmp_path / "empty.mp4"
    empty.touch()
    truncated = lossless(tmp_path / "cut.mp4", numbered(30, 64, 64), 10)
    truncated.write_bytes(truncated.read_bytes()[:-900])
    with pytest.raises(BootifolError) as error:
        import_videos([good, empty, truncated], tmp_path / "out", Conversion(frames=4, size=8))
    assert "empty.mp4 is empty" in str(error.value)
    assert "cut.mp4 holds no pictures (truncated" in str(error.value)
    assert "good.npy" not in str(error.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.mp4", "empty.mp4", "good.npy"]


def test_a_file_truncated_behind_the_first_window_is_still_noticed(tmp_path: Path) -> None:
    path = lossless(tmp_path / "a.gif.mp4", numbered(30, 64, 64), 10)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 4 // 5])
    with pytest.raises(BootifolError, match="truncated"):
        list(convert(path, Conversion(frames=2, size=8, windows="first")))


def test_an_existing_set_is_not_overwritten(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npy", numbered(4))
    import_videos([path], tmp_path / "out", Conversion(frames=4, size=8))
    with pytest.raises(BootifolError, match="exists already"):
        import_videos([path], tmp_path / "out", Conversion(frames=4, size=8))


def test_pictures_without_times_cannot_be_resampled(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npy", numbered(4))
    with pytest.raises(BootifolError, match=r"a\.npy has no times to resample by"):
        import_videos([path], tmp_path / "out", Conversion(frames=4, size=8, frames_per_second=5))


def test_files_of_different_rates_leave_the_rate_unknown(tmp_path: Path) -> None:
    files = [lossless(tmp_path / f"{rate}.mp4", numbered(4, 16, 16), rate) for rate in (10, 20)]
    assert import_videos(files, tmp_path / "out", Conversion(4, 8)).manifest.frames_per_second is None


@pytest.mark.parametrize(
    "fields",
    [{"frames": 1}, {"size": 0}, {"frames_per_second": -1.0}, {"crop": (-1, 0, 8)}, {"crop": (0, 0, 0)}],
)
def test_impossible_conversions_are_refused(fields: dict[str, object]) -> None:
    with pytest.raises(BootifolError):
        Conversion(**fields)  # type: ignore[arg-type]
