import struct
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image
from whole_videos import read_video

from bootifol.errors import BootifolError
from bootifol.video_files.decoding import stream_part
from bootifol.video_files.reading import frame_rate, stream_video, video_paths
from bootifol.video_files.writing import write_video


def blocks(count: int = 20, height: int = 64, width: int = 64) -> np.ndarray:
    """A red block that falls over blue, in large areas that survive compression."""
    frames = np.full((count, height, width, 3), (20, 20, 200), np.uint8)
    for t in range(count):
        frames[t, t : t + height // 3, : width // 2] = (220, 40, 30)
    return frames


def encode(path: Path, codec: str, pixel_format: str, frames: np.ndarray, rate: int = 10) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate)
        stream.height, stream.width = frames.shape[1:3]
        stream.pix_fmt = pixel_format
        for frame in frames:
            picture = av.VideoFrame.from_ndarray(frame, format="rgb24").reformat(format=pixel_format)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def mean_error(left: np.ndarray, right: np.ndarray) -> float:
    return float(np.abs(left.astype(int) - right.astype(int)).mean())


def test_a_video_file_is_as_bright_as_the_pictures_in_it(tmp_path: Path) -> None:
    frames = np.random.default_rng(0).integers(40, 200, (12, 4, 4, 3)).astype(np.uint8)
    frames = frames.repeat(16, axis=1).repeat(16, axis=2)
    write_video(tmp_path / "a.mp4", frames, 10)
    back = read_video(tmp_path / "a.mp4")
    shown = frames.repeat(4, axis=1).repeat(4, axis=2)
    # FFmpeg's quick conversion is 0.6 levels darker in red and blue, and 1.1 in green.
    np.testing.assert_allclose(back.mean((0, 1, 2), np.float64), shown.mean((0, 1, 2), np.float64), atol=0.25)


@pytest.mark.parametrize(
    ("shape", "shown"),
    [((64, 64), (256, 256)), ((84, 84), (336, 336)), ((15, 21), (210, 294)), ((301, 301), (602, 602))],
)
def test_a_written_video_is_enlarged_by_a_whole_even_making_factor(
    tmp_path: Path, shape: tuple[int, int], shown: tuple[int, int]
) -> None:
    frames = blocks(6, *shape)
    write_video(tmp_path / "a.mp4", frames, 25)
    back = read_video(tmp_path / "a.mp4")
    assert back.shape == (6, *shown, 3)
    factor = shown[0] // shape[0]
    middle = factor // 2
    assert mean_error(back[:, middle::factor, middle::factor], frames) < 4
    assert frame_rate(tmp_path / "a.mp4") == 25


def test_a_written_video_plays_in_browsers(tmp_path: Path) -> None:
    write_video(tmp_path / "a.mp4", blocks(), 12.5)
    with av.open(str(tmp_path / "a.mp4")) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert stream.frames == 20
    data = (tmp_path / "a.mp4").read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")  # the index comes first, so it plays while it loads


def test_the_same_frames_write_the_same_bytes(tmp_path: Path) -> None:
    write_video(tmp_path / "a.mp4", blocks(), 25)
    write_video(tmp_path / "b.mp4", blocks(), 25)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


@pytest.mark.parametrize("frames", [np.zeros((0, 8, 8, 3), np.uint8), np.zeros((4, 8, 8), np.uint8)])
def test_nothing_to_write_gives_a_sentence(tmp_path: Path, frames: np.ndarray) -> None:
    with pytest.raises(BootifolError, match="a video needs uint8 frames"):
        write_video(tmp_path / "a.mp4", frames, 25)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "codec", "pixel_format", "tolerance"),
    [("a.webm", "libvpx-vp9", "yuv420p", 8), ("a.gif", "gif", "rgb8", 30), ("a.mov", "mpeg4", "yuv420p", 8)],
)
def test_other_containers_are_read(
    tmp_path: Path, name: str, codec: str, pixel_format: str, tolerance: float
) -> None:
    frames = blocks()
    path = encode(tmp_path / name, codec, pixel_format, frames)
    assert mean_error(read_video(path), frames) < tolerance
    seconds = [timed.seconds for timed in stream_video(path)]
    assert seconds == pytest.approx([t / 10 for t in range(20)], abs=0.011)


def test_a_portrait_video_of_a_phone_stands_upright(tmp_path: Path) -> None:
    frames = np.full((5, 64, 96, 3), 30, np.uint8)
    frames[:, :16, :16] = 250  # bright in the top left corner as stored
    path = encode(tmp_path / "phone.mp4", "libx264", "yuv420p", frames)
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 44
    # "Turn a quarter clockwise", as ISO 14496-12 writes it: 16.16 fixed point, the last column 2.30.
    one = 1 << 16
    data[matrix : matrix + 36] = struct.pack(">9i", 0, one, 0, -one, 0, 0, 64 * one, 0, 1 << 30)
    path.write_bytes(data)
    upright = read_video(path)
    assert upright.shape == (5, 96, 64, 3)
    assert upright[:, :14, -14:].mean() > 200  # top right after the turn
    assert upright[:, :14, :14].mean() < 80


def test_folders_are_read_in_natural_order(tmp_path: Path) -> None:
    for number in (10, 9, 1, 2):
        Image.fromarray(np.full((6, 4, 3), number, np.uint8)).save(tmp_path / f"frame{number}.png")
    (tmp_path / "notes.txt").write_text("not a picture")
    frames = read_video(tmp_path)
    assert frames.shape == (4, 6, 4, 3)
    assert frames[:, 0, 0, 0].tolist() == [1, 2, 9, 10]


def test_arrays_are_read(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", blocks())
    np.testing.assert_array_equal(read_video(tmp_path / "a.npy"), blocks())
    assert frame_rate(tmp_path / "a.npy") is None


def test_the_video_in_an_archive_is_found_among_other_arrays(tmp_path: Path) -> None:
    actions = np.zeros((20, 2), np.float32)
    np.savez_compressed(tmp_path / "a.npz", actions=actions, pictures=blocks())
    np.testing.assert_array_equal(read_video(tmp_path / "a.npz"), blocks())
    assert frame_rate(tmp_path / "a.npz") is None
    assert video_paths([tmp_path]) == [tmp_path / "a.npz"]


def test_an_archive_without_one_video_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, left=blocks(2, 4, 4), right=blocks(3, 4, 4))
    with pytest.raises(BootifolError, match=r"2 arrays .* among left uint8 \[2, 4, 4, 3\], right uint8 \["):
        read_video(path)
    np.savez(path, actions=np.zeros((20, 2)))
    with pytest.raises(BootifolError, match=r"holds no arrays .* among actions float64 \[20, 2\]"):
        read_video(path)
    np.savez(path)
    with pytest.raises(BootifolError, match="among nothing"):
        read_video(path)


def test_nothing_in_an_archive_is_unpickled(tmp_path: Path) -> None:
    notes = np.array([{"a": 1}], dtype=object)
    np.savez(tmp_path / "a.npz", allow_pickle=True, notes=notes, pictures=blocks(2, 4, 4))
    np.testing.assert_array_equal(read_video(tmp_path / "a.npz"), blocks(2, 4, 4))
    np.savez(tmp_path / "b.npz", allow_pickle=True, notes=notes)
    with pytest.raises(BootifolError, match=r"no arrays .* among notes object"):
        read_video(tmp_path / "b.npz")


@pytest.mark.parametrize("damage", ["cut", "changed", "other"])
def test_a_damaged_archive_is_refused_by_name(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, pictures=blocks(2, 8, 8))
    data = bytearray(path.read_bytes())
    if damage == "cut":
        data = data[:-30]
    elif damage == "changed":
        data[300] ^= 1
    else:
        data = bytearray(b"hello")
    path.write_bytes(data)
    with pytest.raises(BootifolError, match=r"a\.npz is damaged"):
        read_video(path)


def test_a_part_of_a_file_is_read_from_its_key_frame_on(tmp_path: Path) -> None:
    write_video(tmp_path / "a.mp4", blocks(), 10)
    whole = read_video(tmp_path / "a.mp4")
    part = list(stream_part(tmp_path / "a.mp4", 0.65, 1.05))
    np.testing.assert_array_equal(np.stack([timed.frame for timed in part]), whole[7:11])
    assert [timed.seconds for timed in part] == pytest.approx([0, 0.1, 0.2, 0.3])
    assert list(stream_part(tmp_path / "a.mp4", 7, 8)) == []


@pytest.mark.parametrize(
    ("name", "codec", "pixel_format", "cut"),
    [
        ("a.mp4", "libx264", "yuv420p", 0.5),
        ("a.webm", "libvpx-vp9", "yuv420p", 0.5),
        ("a.gif", "gif", "rgb8", 0.5),
        ("a.gif", "gif", "rgb8", 0.999),
    ],
)
def test_a_truncated_file_is_refused_by_name(
    tmp_path: Path, name: str, codec: str, pixel_format: str, cut: float
) -> None:
    path = encode(tmp_path / name, codec, pixel_format, blocks())
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * cut)])
    with pytest.raises(BootifolError, match=f"{name} is .*truncated"):
        read_video(path)


def test_a_truncated_video_whose_index_comes_first_is_refused(tmp_path: Path) -> None:
    write_video(tmp_path / "a.mp4", blocks(), 25)
    data = (tmp_path / "a.mp4").read_bytes()
    (tmp_path / "a.mp4").write_bytes(data[:-1])
    with pytest.raises(BootifolError, match=r"a.mp4 is damaged or truncated: \d+ of 20 pictures"):
        read_video(tmp_path / "a.mp4")


def test_files_that_are_no_videos_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "empty.mp4").touch()
    (tmp_path / "text.mp4").write_text("hello")
    (tmp_path / "text.txt").write_text("hello")
    (tmp_path / "folder").mkdir()
    np.save(tmp_path / "float.npy", np.zeros((3, 4, 4, 3)))
    np.save(tmp_path / "pickled.npy", np.array([{}], dtype=object), allow_pickle=True)
    (tmp_path / "mixed").mkdir()
    for number in (4, 5):
        Image.fromarray(np.zeros((number, 4, 3), np.uint8)).save(tmp_path / "mixed" / f"{number}.png")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "1.png").write_bytes(b"\x89PNG\r\n")
    for name, sentence in {
        "empty.mp4": r"empty \(0 bytes\)",
        "text.mp4": "damaged, truncated or no video",
        "text.txt": "not a video bootifol reads",
        "folder": "holds no pictures",
        "float.npy": r"float64 \[3, 4, 4, 3\]",
        "pickled.npy": "damaged or no numpy array",
        "missing.mp4": "does not exist",
        "mixed": r"5\.png is 4×5 pixels",
        "broken": r"1\.png is damaged",
    }.items():
        with pytest.raises(BootifolError, match=sentence) as error:
            read_video(tmp_path / name)
        assert name in str(error.value)


def test_a_file_with_sound_only_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=8000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 4096), np.float32), format="fltp", layout="mono")
        sound.sample_rate = 8000
        container.mux(stream.encode(sound))
        container.mux(stream.encode(None))
    with pytest.raises(BootifolError, match="sound only"):
        read_video(path)
