"""Files as other programs write them, each kind with its neighbors: every picture once, in its order, at its time."""

import struct
import warnings
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from numbered_videos import TWELVE, copied, encode, number, numbered, numbers
from PIL import Image

from bootifol.errors import BootifolError, BootifolWarning
from bootifol.types import Frame
from bootifol.video_files.reading import frame_rate, stream_video

pytestmark = pytest.mark.filterwarnings("ignore::bootifol.errors.BootifolWarning")

MATRICES: dict[tuple[int, int, int, int], Callable[[Frame], Frame]] = {
    (1, 0, 0, 1): lambda frame: frame,
    (0, 1, -1, 0): lambda frame: np.rot90(frame, -1),
    (-1, 0, 0, -1): lambda frame: np.rot90(frame, 2),
    (0, -1, 1, 0): lambda frame: np.rot90(frame, 1),
    (-1, 0, 0, 1): lambda frame: frame[:, ::-1],
    (1, 0, 0, -1): lambda frame: frame[::-1],
    (0, 1, 1, 0): lambda frame: frame.transpose(1, 0, 2),
    (0, -1, -1, 0): lambda frame: np.rot90(frame.transpose(1, 0, 2), 2),
}
"""a, b, c, d of a display matrix, and what it makes of a picture."""


@pytest.mark.parametrize("matrix", MATRICES)
def test_pictures_stand_as_players_show_them(tmp_path: Path, matrix: tuple[int, int, int, int]) -> None:
    path = encode(tmp_path / "phone.mp4", numbered(2))
    data = bytearray(path.read_bytes())
    start = data.index(b"tkhd") + 44
    a, b, c, d = (value << 16 for value in matrix)
    data[start : start + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data)
    shown, right = next(iter(stream_video(path))).frame, MATRICES[matrix](numbered(1)[0])
    assert shown.shape == right.shape
    assert np.abs(shown.astype(int) - right).mean() < 6


@pytest.mark.parametrize("orientation", range(1, 9))
def test_photographs_stand_as_their_exif_says(tmp_path: Path, orientation: int) -> None:
    tags = Image.Exif()
    tags[0x0112] = orientation
    for place in range(2):
        Image.fromarray(numbered(1)[0]).save(tmp_path / f"{place}.jpg", exif=tags, quality=95)
    turns = [None, (1, 0, 0, 1), (-1, 0, 0, 1), (-1, 0, 0, -1), (1, 0, 0, -1), (0, 1, 1, 0), (0, 1, -1, 0)]
    matrix = [*turns, (0, -1, -1, 0), (0, -1, 1, 0)][orientation]
    assert matrix is not None
    shown, right = next(iter(stream_video(tmp_path))).frame, MATRICES[matrix](numbered(1)[0])
    assert shown.shape == right.shape and np.abs(shown.astype(int) - right).mean() < 6


@pytest.mark.parametrize(
    ("codec", "options"),
    [
        ("libx264", {"bf": "1"}),
        ("libx264", {"bf": "8", "g": "30"}),
        ("mpeg4", {"bf": "2"}),
        ("libx264", {"bf": "0"}),
    ],
)
def test_pictures_of_an_avi_keep_their_order_and_times(
    tmp_path: Path, codec: str, options: dict[str, str]
) -> None:
    path = encode(tmp_path / "a.avi", numbered(36), codec, options=options)
    right = [t % 16 for t in range(36)]
    assert numbers(path) == right
    assert numbers(path, 10) == right


def test_dropped_pictures_of_an_avi_are_held_by_the_one_before(tmp_path: Path) -> None:
    whole = encode(tmp_path / "whole.avi", codec="mjpeg", pixel_format="yuvj420p")
    path = copied(whole, tmp_path / "dropped.avi", left_out=(3, 4, 8))
    assert numbers(path) == [0, 1, 2, 5, 6, 7, 9, 10, 11]
    assert numbers(path, 10) == [0, 1, 2, 2, 2, 5, 6, 7, 7, 9, 10, 11]


@pytest.mark.parametrize("suffix", ["ts", "mpg", "flv"])
def test_files_put_one_behind_another_are_read_through(tmp_path: Path, suffix: str) -> None:
    codec, rate = ("mpeg2video", 25) if suffix == "mpg" else ("libx264", 10)
    whole = encode(tmp_path / f"one.{suffix}", codec=codec, rate=rate, options={"bf": "0"}).read_bytes()
    path = tmp_path / f"two.{suffix}"
    path.write_bytes(whole + (whole[13:] if suffix == "flv" else whole))
    with pytest.warns(BootifolWarning, match="times run backward"):
        assert numbers(path) == TWELVE * 2
    assert numbers(path, rate) == TWELVE * 2


GROUPS = {
    "closed": ("libx264", {"x264-params": "keyint=12:min-keyint=12:bframes=3:scenecut=0:repeat-headers=1"}),
    "open": (
        "libx264",
        {"x264-params": "open-gop=1:keyint=12:min-keyint=12:bframes=3:scenecut=0:repeat-headers=1"},
    ),
    "hevc": (
        "libx265",
        {"x265-params": "open-gop=1:keyint=12:min-keyint=12:bframes=3:scenecut=0:log-level=none"},
    ),
}


@pytest.mark.parametrize("group", GROUPS)
def test_a_lossless_trim_shows_what_a_player_shows(tmp_path: Path, group: str) -> None:
    codec, options = GROUPS[group]
    whole = encode(tmp_path / "whole.mp4", numbered(30), codec, options=options)
    for start in (12, 15):
        right = [t % 16 for t in range(start, 30)]
        for suffix in ("mp4", "mov"):  # an edit list hides what comes before
            path = copied(whole, tmp_path / f"trim{start}.{suffix}", start / 10)
            assert numbers(path) == right
            assert numbers(path, 10) == right
    for suffix in ("mkv", "ts"):  # leading pictures build on what was cut off
        assert numbers(copied(whole, tmp_path / f"trim.{suffix}", 1.2)) == [t % 16 for t in range(12, 30)]


@pytest.mark.parametrize(
    ("name", "codec", "rate"),
    [
        ("a.webm", "libvpx", Fraction(30000, 1001)),
        ("a.webm", "libvpx", Fraction(24)),
        ("a.webm", "libvpx", Fraction(60)),
        ("a.mkv", "libx264", Fraction(60000, 1001)),
        ("a.flv", "libx264", Fraction(30)),
        ("a.ts", "libx264", Fraction(24000, 1001)),
        ("a.mp4", "libx264", Fraction(30000, 1001)),
        ("a.avi", "mpeg4", Fraction(24000, 1001)),
    ],
)
def test_every_picture_comes_once_at_the_files_own_rate(
    tmp_path: Path, name: str, codec: str, rate: Fraction
) -> None:
    path = encode(tmp_path / name, numbered(60), codec, rate=rate)
    right = [t % 16 for t in range(60)]
    assert numbers(path, float(rate)) == right
    assert numbers(path, round(float(rate), 2)) == right


@pytest.mark.parametrize(("ticks", "rate"), [(25, 10), (30, 24), (100, 30), (600, 29.97), (90, 24), (15, 10)])
@pytest.mark.parametrize("rounded", [round, int])
def test_a_timescale_that_cannot_hold_the_rate_loses_no_picture(
    tmp_path: Path, ticks: int, rate: float, rounded: Callable[[float], int]
) -> None:
    stamps = [rounded(t * ticks / rate) for t in range(48)]
    path = encode(
        tmp_path / "a.mp4",
        numbered(48),
        rate=round(rate),
        stamps=(Fraction(1, ticks), stamps),
        container_options={"video_track_timescale": str(ticks)},
    )
    assert numbers(path, rate) == [t % 16 for t in range(48)]


@pytest.mark.parametrize(
    ("hundredths", "right"),
    [
        ([10] * 5, [0, 1, 2, 3, 4]),
        ([50, 10, 10], [0, 0, 0, 0, 0, 1, 2]),
        ([10, 30, 10], [0, 1, 1, 1, 2]),
        ([10, 10, 100], [0, 1] + [2] * 10),
        ([10, 20] * 2, [0, 1, 1, 2, 3, 3]),
        ([0] * 4, [0, 1, 2, 3]),
        ([30], [0, 0, 0]),
    ],
)
@pytest.mark.parametrize("suffix", ["gif", "webp", "png"])
def test_frames_of_an_animation_show_by_their_times(
    tmp_path: Path, suffix: str, hundredths: list[int], right: list[int]
) -> None:
    if suffix != "gif" and len(hundredths) < 2:
        pytest.skip("a still picture")
    path = tmp_path / f"a.{suffix}"
    first, *others = map(Image.fromarray, numbered(len(hundredths)))
    first.save(
        path, save_all=True, append_images=others, duration=[10 * h for h in hundredths], lossless=True
    )
    assert numbers(path) == list(range(len(hundredths)))
    assert numbers(path, 10) == right


def test_stacks_and_sequences_of_pictures_in_one_file_are_videos(tmp_path: Path) -> None:
    for name in ("a.tiff", "a.avif"):
        first, *others = map(Image.fromarray, numbered(5))
        first.save(tmp_path / name, save_all=True, append_images=others)
        assert numbers(tmp_path / name) == [0, 1, 2, 3, 4]
    Image.fromarray(numbered(1)[0]).save(tmp_path / "one.webp")
    with pytest.raises(BootifolError, match=r"one\.webp is one picture, no video"):
        numbers(tmp_path / "one.webp")


@pytest.mark.parametrize(
    ("name", "codec", "pixel_format"),
    [
        ("a.webm", "libvpx-vp9", "yuva420p"),
        ("a.mkv", "libvpx-vp9", "yuva420p"),
        ("a.mov", "prores_ks", "yuva444p10le"),
        ("b.mov", "qtrle", "argb"),
        ("b.mkv", "ffv1", "bgra"),
    ],
)
def test_hidden_colors_do_not_show(tmp_path: Path, name: str, codec: str, pixel_format: str) -> None:
    path = encode(tmp_path / name, transparent(), codec, pixel_format)
    assert numbers(path) == TWELVE and numbers(path, 10) == TWELVE
    assert min(timed.frame[34:46, 44:62].mean() for timed in stream_video(path)) > 250


@pytest.mark.parametrize("suffix", ["gif", "webp", "png"])
def test_hidden_colors_of_animations_do_not_show(tmp_path: Path, suffix: str) -> None:
    first, *others = map(Image.fromarray, transparent())
    first.save(
        tmp_path / f"a.{suffix}", save_all=True, append_images=others, duration=100, disposal=2, lossless=True
    )
    assert min(timed.frame[34:46, 44:62].mean() for timed in stream_video(tmp_path / f"a.{suffix}")) > 250


def transparent() -> np.ndarray:
    """Numbered pictures with green that does not show at the lower right."""
    frames = np.concatenate([numbered(), np.full((12, 48, 64, 1), 255, np.uint8)], axis=-1)
    frames[:, 32:, 42:] = (0, 161, 0, 0)
    return frames


@pytest.mark.parametrize(("transfer", "white"), [(18, 720), (16, 572)])
@pytest.mark.parametrize(
    ("name", "codec"), [("a.mov", "libx264"), ("a.mp4", "libx265"), ("a.mkv", "libx264")]
)
def test_diffuse_white_of_high_dynamic_range_is_white(
    tmp_path: Path, name: str, codec: str, transfer: int, white: int
) -> None:
    """75 % of HLG and 58 % of PQ; a fifth of its light is level 111 of BT.709."""
    fifth = {18: 463, 16: 433}[transfer]
    luma = np.repeat(np.array([64, fifth, white, 940], np.uint16), 16)[None].repeat(32, axis=0)
    path = tmp_path / name
    quiet = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=10, options=quiet | {"crf": "1"})
        stream.height, stream.width, stream.pix_fmt = 32, 64, "yuv420p10le"
        for target in (stream.codec_context, frame := av.VideoFrame(64, 32, "yuv420p10le")):
            target.color_trc, target.color_primaries, target.colorspace, target.color_range = (
                transfer,
                9,
                9,
                1,
            )
        for plane, values in zip(
            frame.planes, (luma, np.full((16, 32), 512), np.full((16, 32), 512)), strict=True
        ):
            padded = np.zeros((plane.height, plane.line_size // 2), np.uint16)
            padded[:, : plane.width] = values
            plane.update(padded.tobytes())
        for t in range(3):
            frame.pts, frame.time_base = t, Fraction(1, 10)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    with pytest.warns(BootifolWarning, match="high dynamic range"):
        shown = next(iter(stream_video(path))).frame[16, 8::16].astype(int)
    assert np.ptp(shown, axis=1).max() <= 1, "gray stays gray"
    np.testing.assert_allclose(shown[:, 1], [0, 111, 255, 255], atol=4)


@pytest.mark.parametrize(
    ("name", "sizes", "default", "taken"),
    [
        ("a.mkv", [(24, 32), (48, 64)], 0, 0),
        ("a.mkv", [(24, 32), (48, 64)], 1, 1),
        ("a.mkv", [(96, 128), (48, 64)], 1, 1),
        ("a.ts", [(24, 32), (48, 64)], None, 1),
        ("a.ts", [(48, 64), (24, 32)], None, 0),
    ],
)
def test_the_default_track_is_taken_or_the_largest(
    tmp_path: Path, name: str, sizes: list[tuple[int, int]], default: int | None, taken: int
) -> None:
    with av.open(str(tmp_path / name), "w") as container:
        streams = []
        for place, (height, width) in enumerate(sizes):
            stream = container.add_stream("libx264", rate=10)
            stream.height, stream.width, stream.pix_fmt = height, width, "yuv420p"
            if default is not None:
                flags = av.stream.Disposition
                stream.disposition = flags.default if place == default else flags(0)
            streams.append(stream)
        for t in range(3):
            for stream, (height, width) in zip(streams, sizes, strict=True):
                frame = av.VideoFrame.from_ndarray(numbered(3, height, width)[t], format="rgb24")
                frame.pts, frame.time_base = t, Fraction(1, 10)
                container.mux(stream.encode(frame.reformat(format="yuv420p")))
        for stream in streams:
            container.mux(stream.encode(None))
    with pytest.warns(BootifolWarning, match=f"has 2 video tracks .*: number {taken + 1} was taken"):
        shown = next(iter(stream_video(tmp_path / name))).frame
    assert shown.shape[:2] == sizes[taken]


def test_a_picture_of_the_file_itself_is_no_track(tmp_path: Path) -> None:
    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        streams = [container.add_stream("mjpeg", rate=10), container.add_stream("libx264", rate=10)]
        for stream, (height, width) in zip(streams, [(96, 128), (48, 64)], strict=True):
            stream.height, stream.width = height, width
            stream.pix_fmt = "yuvj420p" if stream is streams[0] else "yuv420p"
        streams[0].disposition = av.stream.Disposition.attached_pic
        for t in range(3):
            for stream in streams if t == 0 else streams[1:]:
                frame = av.VideoFrame.from_ndarray(
                    numbered(3, stream.height, stream.width)[t], format="rgb24"
                )
                frame.pts, frame.time_base = t, Fraction(1, 10)
                container.mux(stream.encode(frame.reformat(format=stream.pix_fmt)))
        for stream in streams:
            container.mux(stream.encode(None))
    with warnings.catch_warnings():
        warnings.simplefilter("error", BootifolWarning)
        assert numbers(tmp_path / "a.mp4") == [0, 1, 2]


FRAGMENTED = {"movflags": "frag_keyframe+empty_moov+default_base_moof"}


def test_a_file_in_fragments_is_read_whole_and_refused_when_it_lacks_its_end(tmp_path: Path) -> None:
    options = {"g": "4", "bf": "0"}
    path = encode(tmp_path / "a.mp4", options=options, container_options=FRAGMENTED)
    assert numbers(path) == TWELVE
    data = path.read_bytes()
    for end in (data.rindex(b"mfra") - 4, data.rindex(b"moof") - 4):
        path.write_bytes(data[:end])
        with pytest.raises(BootifolError, match=r"is cut: it was written in fragments.*\(mfra\) is missing"):
            numbers(path)


def test_a_file_in_fragments_by_who_writes_no_index_is_read_and_told(tmp_path: Path) -> None:
    path = encode(tmp_path / "a.mp4", options={"g": "4", "bf": "0"}, container_options=FRAGMENTED)
    data = path.read_bytes()
    path.write_bytes(data[: data.rindex(b"mfra") - 4].replace(b"Lavf", b"Cam1"))
    with pytest.warns(BootifolWarning, match="does not say how long it is"):
        assert numbers(path) == TWELVE


@pytest.mark.parametrize(
    ("name", "codec", "container"),
    [
        ("a.wmv", "wmv2", None),
        ("a.mpg", "mpeg1video", None),
        ("a.VOB", "mpeg2video", "vob"),
        ("a.m2ts", "libx264", None),
        ("a.3gp", "libx264", None),
        ("a.mxf", "mpeg2video", None),
        ("a.nut", "mpeg4", None),
        ("a.divx", "mpeg4", "avi"),
        ("without_suffix", "libx264", "mp4"),
        ("a.bin", "libx264", "matroska"),
        ("clip:1.mp4", "libx264", None),
        ("50%03d.mp4", "libx264", None),
        ("#1?.mp4", "libx264", None),
    ],
)
def test_whatever_the_decoder_reads_is_read(
    tmp_path: Path, name: str, codec: str, container: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    encode(
        tmp_path / "plain",
        codec=codec,
        rate=25,
        container_format=container
        or name.split(".")[-1].lower().replace("m2ts", "mpegts").replace("wmv", "asf").replace("mpg", "mpeg"),
    ).rename(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert numbers(Path(name)) == TWELVE
    assert numbers(Path(name), 25) == TWELVE
    assert frame_rate(Path(name)) in (25, None)


@pytest.mark.parametrize(
    ("name", "codec"), [("a.h264", "libx264"), ("a.m2v", "mpeg2video"), ("a.mjpeg", "mjpeg")]
)
def test_a_raw_stream_has_pictures_and_no_times(tmp_path: Path, name: str, codec: str) -> None:
    path = encode(
        tmp_path / name, codec=codec, rate=25, pixel_format="yuvj420p" if codec == "mjpeg" else "yuv420p"
    )
    assert numbers(path) == TWELVE
    assert frame_rate(path) is None
    with pytest.raises(BootifolError, match="has no times to resample by"):
        numbers(path, 25)


def test_a_text_is_no_video_whatever_plays_it(tmp_path: Path) -> None:
    for name in ("a.txt", "a.nfo", "a.ans", "a.m3u8", "a.ffconcat"):
        (tmp_path / name).write_text("#EXTM3U\nffconcat version 1.0\nfile 'b.mp4'\n" * 50)
        with pytest.raises(BootifolError, match="not a video bootifol reads"):
            numbers(tmp_path / name)


STAND_INS = {
    b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 5\n": "git lfs pull",
    b"/annex/objects/MD5E-s5--0.mp4\n": "git annex get",
    b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X        ": "AppleDouble",
    b"\n<!DOCTYPE html><html><body>Sign in</body></html>": "a web page",
}


@pytest.mark.parametrize("contents", STAND_INS)
@pytest.mark.parametrize("name", ["a.mp4", "a.npy", "a.gif", "a.bin", "take/1.png"])
def test_what_stands_in_for_a_file_is_recognized(tmp_path: Path, name: str, contents: bytes) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(contents)
    with pytest.raises(BootifolError, match=STAND_INS[contents]):
        numbers(path if path.parent == tmp_path else path.parent)


def test_a_mirrored_number_would_be_seen() -> None:
    assert [number(frame) for frame in numbered(12)] == TWELVE
    assert [number(frame[:, ::-1]) for frame in numbered(12)] != TWELVE
