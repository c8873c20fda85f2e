"""Video files as they come from phones, editors and converters, and broken ones: each with what reading it must give.

python -m tests.video_files.awkward_files DIRECTORY
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image

Pictures = NDArray[np.uint8]

RATE = 10


@dataclass(frozen=True)
class Awkward:
    """One file and what importing it must give: these pictures, or a refusal."""

    path: Path
    pictures: Pictures | None = None
    """uint8 `[frames, H, W, 3]`; None for files to refuse."""
    seconds: Sequence[float] | None = None
    """When the pictures appear, where that is the awkward part."""
    tolerance: float = 8.0
    """Mean absolute difference allowed, in levels of 255."""
    refusal: str = ""
    """A part of the sentence that refuses the file, as a regular expression."""


def scene(count: int = 12, height: int = 48, width: int = 64) -> Pictures:
    """A red block that falls over blue, with a bright corner at the top left that tells which way is up."""
    frames = np.full((count, height, width, 3), (20, 20, 200), np.uint8)
    for t in range(count):
        frames[t, 2 * t : 2 * t + height // 3, width // 2 :] = (220, 40, 30)
    frames[:, : height // 4, : width // 4] = 250
    return frames


def make_all(directory: Path) -> list[Awkward]:
    """Writes the whole corpus into an empty directory."""
    directory.mkdir(parents=True, exist_ok=True)
    makers: list[Callable[[Path], list[Awkward]]] = [
        _turned,
        _sizes_and_formats,
        _times,
        _gifs,
        _alpha,
        _folders,
        _arrays,
        _other_programs,
        _broken,
    ]
    return [file for make in makers for file in make(directory)]


def encode(
    path: Path,
    frames: Pictures,
    codec: str = "libx264",
    pixel_format: str = "yuv420p",
    times: Sequence[int] | None = None,
    aspect: Fraction | None = None,
    options: dict[str, str] | None = None,
    container_options: dict[str, str] | None = None,
    sound: bool = False,
) -> Path:
    """Writes a video file.

    Args:
        times: of the frames in tenths of a second; 0, 1, 2 … by default.
        aspect: width of a pixel divided by its height.
        sound: add a silent track that outlasts the pictures.
    """
    source = {3: "rgb24", 4: "rgba"}[frames.shape[-1]]
    with av.open(str(path), "w", options=container_options or {}) as container:
        stream: Any = container.add_stream(codec, rate=RATE, options=options or {})
        stream.height, stream.width = frames.shape[1:3]
        stream.pix_fmt = pixel_format
        stream.codec_context.thread_count = 1
        if aspect is not None:
            stream.codec_context.sample_aspect_ratio = aspect
        voice: Any = container.add_stream("aac", rate=8000) if sound else None
        for number, frame in enumerate(frames):
            picture = av.VideoFrame.from_ndarray(frame, format=source).reformat(format=pixel_format)
            picture.pts = number if times is None else times[number]
            picture.time_base = Fraction(1, RATE)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
        if voice is not None:
            silence = av.AudioFrame.from_ndarray(
                np.zeros((1, 8000 * 3), np.float32), format="fltp", layout="mono"
            )
            silence.sample_rate = 8000
            container.mux(voice.encode(silence))
            container.mux(voice.encode(None))
    return path


def _turned(directory: Path) -> list[Awkward]:
    one = 1 << 16
    found = []
    # Matrices as ISO 14496-12 writes them: 16.16 fixed point, the last column 2.30; the turn is clockwise.
    for degrees, (a, b, c, d) in {90: (0, 1, -1, 0), 180: (-1, 0, 0, -1), 270: (0, -1, 1, 0)}.items():
        path = encode(directory / f"turned_{degrees}.mp4", scene())
        data = bytearray(path.read_bytes())
        start = data.index(b"tkhd") + 44
        data[start : start + 36] = struct.pack(">9i", a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30)
        path.write_bytes(data)
        found.append(Awkward(path, np.rot90(scene(), -degrees // 90, axes=(1, 2))))
    return found


def _sizes_and_formats(directory: Path) -> list[Awkward]:
    odd = scene(12, 37, 51)
    gray = scene().astype(float) @ [0.299, 0.587, 0.114]
    gray = ((gray - 16) * 255 / 219).clip(
        0, 255
    )  # stored as if 16 were black and 235 white, as players assume
    wide = encode(directory / "wide_pixels.mp4", scene(), aspect=Fraction(2))
    tall = encode(directory / "tall_pixels.mp4", scene(), aspect=Fraction(1, 2))
    return [
        Awkward(encode(directory / "odd_size.mp4", odd, pixel_format="yuv444p"), odd),
        Awkward(encode(directory / "every_color.mp4", scene(), pixel_format="yuv444p"), scene(), tolerance=4),
        Awkward(encode(directory / "ten_bit.mp4", scene(), pixel_format="yuv420p10le"), scene()),
        Awkward(
            encode(directory / "gray.mp4", scene(), pixel_format="gray"),
            gray.round().astype(np.uint8)[..., None].repeat(3, axis=-1),
        ),
        Awkward(encode(directory / "vp9.webm", scene(), "libvpx-vp9"), scene()),
        Awkward(encode(directory / "camera.avi", scene(), "mjpeg", "yuvj420p"), scene(), tolerance=10),
        Awkward(encode(directory / "old.mov", scene(), "mpeg4"), scene(), tolerance=10),
        Awkward(wide, scene().repeat(2, axis=2)),
        Awkward(tall, scene().repeat(2, axis=1)),
    ]


def _times(directory: Path) -> list[Awkward]:
    uneven = [0, 1, 2, 6, 7, 13, 14, 15, 21, 22, 23, 30]
    sparse = [0, 200, 400, 599]
    edited = encode(directory / "edit_list.mp4", scene(), options={"bf": "0", "g": "1"})
    data = bytearray(edited.read_bytes())
    entry = data.index(b"elst") + 12  # after version, flags and count: duration, start in the media
    (duration,) = struct.unpack(">I", data[entry : entry + 4])
    with av.open(str(edited)) as container:
        tick = container.streams.video[0].time_base
    assert tick is not None
    data[entry : entry + 8] = struct.pack(">Ii", duration * 8 // 12, int(Fraction(4, RATE) / tick))
    edited.write_bytes(data)
    return [
        Awkward(
            encode(directory / "uneven.mp4", scene(), times=uneven), scene(), [time / RATE for time in uneven]
        ),
        Awkward(
            encode(directory / "a_minute.mp4", scene(4), times=sparse),
            scene(4),
            [time / RATE for time in sparse],
        ),
        Awkward(encode(directory / "sound.mp4", scene(), sound=True), scene()),
        Awkward(edited, scene()[4:]),
        Awkward(encode(directory / "one_frame.mp4", scene(1)), scene(1)),
        Awkward(encode(directory / "two_frames.mp4", scene(2)), scene(2)),
    ]


def _gifs(directory: Path) -> list[Awkward]:
    """A moving dot in frames that say what becomes of them: 1 stays, 2 is cleared, 3 gives way to what was before."""
    found = []
    for disposal in (1, 2, 3):
        canvas = Image.new("RGBA", (40, 30), (0, 0, 0, 0))
        frames, expected = [], []
        for t in range(4):
            picture = canvas.copy()
            picture.paste((200, 30, 30, 255), (8 * t, 10, 8 * t + 8, 20))
            frames.append(picture)
            shown = np.full((30, 40, 3), 255, np.uint8)
            shown[10:20, 8 * t : 8 * t + 8] = (200, 30, 30)
            expected.append(shown)
        if disposal == 1:  # nothing is cleared: the dots add up
            expected = [np.minimum.reduce(expected[: t + 1]) for t in range(4)]
        path = directory / f"disposal_{disposal}.gif"
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=100, disposal=disposal)
        found.append(Awkward(path, np.stack(expected), tolerance=3))
    return found


def _alpha(directory: Path) -> list[Awkward]:
    """What is half transparent is half white; what is hidden does not show."""
    frames = np.concatenate([scene(), np.full((12, 48, 64, 1), 255, np.uint8)], axis=-1)
    frames[:, 30:, :, 3] = 0
    frames[:, :30, :10, 3] = 128
    fraction = frames[..., 3:].astype(float) / 255
    expected = (frames[..., :3] * fraction + 255 * (1 - fraction)).round().astype(np.uint8)
    folder = directory / "transparent"
    folder.mkdir()
    for number, frame in enumerate(frames):
        Image.fromarray(frame).save(folder / f"{number}.png")
    return [
        Awkward(encode(directory / "transparent.mov", frames, "png", "rgba"), expected, tolerance=2),
        Awkward(folder, expected, tolerance=1),
    ]


def _folders(directory: Path) -> list[Awkward]:
    deep, palette, lying, mixed, broken = (
        directory / name
        for name in ("sixteen_bit", "palette", "lying_jpegs", "mixed_sizes", "broken_picture")
    )
    for folder in (deep, palette, lying, mixed, broken):
        folder.mkdir()
    levels = scene()[..., 0]
    for number, frame in enumerate(scene()):
        Image.fromarray(levels[number].astype(np.uint16) * 257).save(deep / f"{number}.png")
        Image.fromarray(frame).quantize(8).save(palette / f"{number}.png")
        tags = Image.Exif()
        tags[0x0112] = 6  # turn a quarter clockwise
        Image.fromarray(frame).save(lying / f"{number}.jpg", exif=tags, quality=95)
        Image.fromarray(frame[: 48 - (number == 6)]).save(mixed / f"{number}.png")
        Image.fromarray(frame).save(broken / f"{number}.png")
    whole = (broken / "5.png").read_bytes()
    (broken / "5.png").write_bytes(whole[: len(whole) // 2])
    return [
        Awkward(deep, levels[..., None].repeat(3, axis=-1), tolerance=1),
        Awkward(palette, scene(), tolerance=3),
        Awkward(lying, np.rot90(scene(), -1, axes=(1, 2))),
        Awkward(mixed, refusal=r"6\.png is 64×47 pixels and the pictures before it are 64×48"),
        Awkward(broken, refusal=r"5\.png is damaged"),
    ]


def _arrays(directory: Path) -> list[Awkward]:
    np.save(directory / "columns_first.npy", np.asfortranarray(scene()))
    np.savez_compressed(directory / "with_actions.npz", pictures=scene(), actions=np.zeros((11, 2)))
    np.savez(directory / "two_videos.npz", left=scene(), right=scene())
    np.save(directory / "floats.npy", scene() / 255)
    np.save(directory / "objects.npy", np.array([{}], dtype=object), allow_pickle=True)
    whole = (directory / "columns_first.npy").read_bytes()
    (directory / "cut.npy").write_bytes(whole[:-5])
    return [
        Awkward(directory / "columns_first.npy", scene(), tolerance=0),
        Awkward(directory / "with_actions.npz", scene(), tolerance=0),
        Awkward(directory / "two_videos.npz", refusal="2 arrays that could be the video"),
        Awkward(directory / "floats.npy", refusal="holds float64"),
        Awkward(directory / "objects.npy", refusal="damaged or no numpy array"),
        Awkward(directory / "cut.npy", refusal="damaged or no numpy array"),
    ]


def _other_programs(directory: Path) -> list[Awkward]:
    """Pictures that are stored in another order, hidden, held or transparent."""
    b_frames = encode(directory / "b_frames.avi", scene(), options={"bf": "3"})
    shown = np.concatenate([scene(), np.full((12, 48, 64, 1), 255, np.uint8)], axis=-1)
    shown[:, 30:, :, 3] = 0
    white = scene()
    white[:, 30:] = 255
    group = "keyint=6:min-keyint=6:open-gop=1:scenecut=0:bframes=2"
    trimmed = encode(directory / "trimmed.mp4", scene(), options={"x264-params": group})
    data = bytearray(trimmed.read_bytes())
    entry = data.index(b"elst") + 12
    with av.open(str(trimmed)) as container:
        tick = container.streams.video[0].time_base
    assert tick is not None
    duration, start = struct.unpack(">Ii", data[entry : entry + 8])
    data[entry : entry + 8] = struct.pack(">Ii", duration * 5 // 12, start + int(Fraction(7, RATE) / tick))
    trimmed.write_bytes(data)
    first, *others = map(Image.fromarray, scene())
    times = [100 * t + 400 * (t > 5) for t in range(12)]
    lasts = [100] * 5 + [500] + [100] * 6
    animations = []
    for name in ("held.gif", "held.webp", "held.png"):
        path = directory / name
        first.save(path, save_all=True, append_images=others, duration=lasts, lossless=True)
        animations.append(Awkward(path, scene(), [time / 1000 for time in times], tolerance=10))
    return [
        Awkward(b_frames, scene(), [t / RATE for t in range(12)]),
        Awkward(trimmed, scene()[7:]),
        Awkward(encode(directory / "hidden.webm", shown, "libvpx-vp9", "yuva420p"), white, tolerance=10),
        Awkward(encode(directory / "stream.ts", scene(), options={"bf": "2"}), scene()),
        Awkward(
            encode(directory / "fragments.mp4", scene(), options={"g": "4"}, container_options=_FRAGMENTED),
            scene(),
        ),
        *animations,
    ]


_FRAGMENTED = {"movflags": "frag_keyframe+empty_moov"}


def _broken(directory: Path) -> list[Awkward]:
    index_last = encode(directory / "index_last.mp4", scene()).read_bytes()
    faststart = {"movflags": "+faststart"}
    index_first = encode(directory / "index_first.mp4", scene(), container_options=faststart).read_bytes()
    webm = encode(directory / "whole.webm", scene(), "libvpx-vp9").read_bytes()
    avi = encode(directory / "whole.avi", scene(), "mjpeg", "yuvj420p").read_bytes()
    np.savez(directory / "whole.npz", pictures=scene())
    archive = (directory / "whole.npz").read_bytes()
    brace = archive.index(b"}")
    contents = {
        "cut_in_the_last_picture.webm": (webm[:-40], "truncated"),
        "cut_in_the_last_picture.avi": (avi[: avi.rindex(b"idx1") - 9], "truncated"),
        "cut_before_the_last_picture.avi": (avi[: avi.rindex(b"00dc", 0, avi.rindex(b"idx1"))], "truncated"),
        "open_header.npz": (archive[:brace] + b" " + archive[brace + 1 :], "damaged"),
        "cut_in_the_pictures.mp4": (
            index_first[: int(len(index_first) * 0.8)],
            r"damaged or truncated: \d+ of 12",
        ),
        "cut_by_a_byte.mp4": (index_first[:-1], r"damaged or truncated: \d+ of 12"),
        "cut_in_the_index.mp4": (index_last[:-200], "holds no pictures|damaged"),
        "cut_before_the_index.mp4": (
            index_last[: index_last.index(b"moov") - 4],
            "damaged, truncated or no video",
        ),
        "cut.webm": (webm[: len(webm) * 2 // 3], "truncated"),
        "empty.mp4": (b"", r"empty \(0 bytes\)"),
        "text.mp4": (b"Dear reader,\nthis is no video.\n", "damaged, truncated or no video"),
        "zeros.mp4": (bytes(5000), "damaged, truncated or no video"),
    }
    for name, (data, _) in contents.items():
        (directory / name).write_bytes(data)
    for name in ("index_last.mp4", "index_first.mp4", "whole.webm", "whole.avi", "whole.npz"):
        (directory / name).unlink()
    return [Awkward(directory / name, refusal=refusal) for name, (_, refusal) in contents.items()]


if __name__ == "__main__":
    for file in make_all(Path(sys.argv[1])):
        print(file.path, "refused" if file.pictures is None else list(file.pictures.shape))
