"""Do videos look like the environment? Brightness, color, contrast, and where things stand in the picture.

First frames are compared with first frames: what happens later is up to whoever acts.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from bootifol.envs.pictures import PictureConfig
from bootifol.files import written_aside
from bootifol.tasks import Task, make_environment
from bootifol.types import Frame, FrameBatch, Frames

FIRST_FRAMES_NAME = "first_frames.png"

SEEDS = 24
"""Starts of the environment that are looked at. Their means differ by less than 0.2 levels from 64 recorded ones."""

BRIGHTNESS_LEVELS = 8.0
"""Difference of the mean brightness, of 255, that is worth a sentence. Recorded videos differ by 0.1, compressed and
imported again by 1.4; a third of a stop of exposure is about 15."""

COLOR_LEVELS = 4.0
"""The same for a channel after the brightness is made equal. One channel amplified by a fifth moves it by 5."""

CONTRAST_RATIO = 1.2
"""Ratio of spreads (standard deviations over pixels) worth a sentence. Recorded videos are within 1.01."""

SCENE_LEVELS = 1.5
"""Mean difference of the median pictures, brightness and contrast made equal. Recorded videos differ by 0.4 at most; a
camera that is turned, or moved by 1/30 of the picture, by 1.8 or more."""

SCENE_NOISE = 2.0
"""And it must exceed this many times what as few of the environment's own pictures differ by."""

_SHOWN = 8
_GAP = 4
_LABEL = 22
_SMALLEST_PICTURE = 128


@cache
def first_frames(task: Task, pictures: PictureConfig) -> Frames:
    """How the environment looks at the start of `SEEDS` episodes, uint8 `[SEEDS, H, W, 3]`; once a process."""
    environment = make_environment(task.name, pictures, task.episode_steps, task.action_repeat)
    try:
        return np.stack([environment.reset(seed=seed)[1]["video_frame"] for seed in range(SEEDS)])
    finally:
        environment.close()


def differences_of_looks(videos: FrameBatch, environment: Frames, picture: Path) -> list[str]:
    """How first frames of videos differ from the environment's, one sentence each, with what to do about it.

    Args:
        videos: first frames, uint8 `[n, H, W, 3]`.
        environment: first frames of episodes, uint8 `[m, H, W, 3]`.
        picture: the file that shows both, named in the sentence about the scene.
    """
    mean, spread = _statistics(videos)
    expected, expected_spread = _statistics(environment)
    found = []
    brightness = float(mean.mean() - expected.mean())
    if abs(brightness) > BRIGHTNESS_LEVELS:
        found.append(
            f"the videos are {'brighter' if brightness > 0 else 'darker'} than the environment by "
            f"{abs(brightness):.0f} levels of 255: change the exposure or the lighting of one of them"
        )
    tint = (mean - mean.mean()) - (expected - expected.mean())
    if np.abs(tint).max() > COLOR_LEVELS:
        listed = ", ".join(f"{name} {value:+.0f}" for name, value in zip(_CHANNELS, tint, strict=True))
        found.append(
            f"the videos' colors differ from the environment's ({listed} levels of 255 at equal brightness): set a "
            "fixed white balance, or correct the colors before you import"
        )
    ratio = float(spread.mean() / max(expected_spread.mean(), 1e-6))
    if not 1 / CONTRAST_RATIO < ratio < CONTRAST_RATIO:
        found.append(
            f"the videos have {ratio:.2f} times the contrast of the environment (spread of the channels "
            f"{_levels(spread)} instead of {_levels(expected_spread)}): is the background the same, is there haze or "
            "glare, is the exposure right?"
        )
    scene = _scene_difference(videos, environment)
    noise = _scene_noise(environment, len(videos))
    if scene > max(SCENE_LEVELS, SCENE_NOISE * noise):
        found.append(
            f"things stand elsewhere in the videos than in the environment, or the background is another (mean "
            f"difference {scene:.1f} levels of 255, usually below {SCENE_LEVELS:g}): look at {picture} and film from "
            "where the environment's camera stands, or crop the videos to its view"
        )
    return found


def write_first_frames(directory: Path, videos: FrameBatch, environment: Frames) -> Path:
    """Writes `first_frames.png`: videos above environment, and below their means and the absolute difference.

    Args:
        directory: of the demo set.
        videos: first frames, uint8 `[n, H, W, 3]`.
        environment: the same of episodes, uint8 `[m, H, W, 3]`.
    """
    means = [batch.mean(0) for batch in (videos, environment)]
    shown = np.unique(np.linspace(0, len(videos) - 1, _SHOWN).round().astype(int))
    rows: list[tuple[str, list[Frame]]] = [
        ("videos: first frames", list(videos[shown])),
        ("environment: first frames of several seeds", list(environment[:_SHOWN])),
        (
            "means of videos and environment, and how much they differ",
            [picture.round().astype(np.uint8) for picture in (*means, np.abs(means[0] - means[1]))],
        ),
    ]
    target = directory / FIRST_FRAMES_NAME
    with written_aside(target) as aside:
        _labelled(rows).save(aside, format="png")
    return target


_CHANNELS = ("red", "green", "blue")


def _statistics(pictures: Frames) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation over pixels of each channel."""
    pixels = pictures.reshape(-1, 3).astype(np.float64)
    return pixels.mean(0), pixels.std(0)


def _levels(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.0f}" for value in values)


def _scene_difference(left: Frames, right: Frames) -> float:
    """Mean absolute difference of the median pictures, the left one with the right one's brightness and contrast."""
    one, other = np.median(left, axis=0), np.median(right, axis=0)
    contrast = other.std((0, 1)) / np.maximum(one.std((0, 1)), 1e-6)
    equal = (one - one.mean((0, 1))) * contrast + other.mean((0, 1))
    return float(np.abs(equal - other).mean())


def _scene_noise(environment: Frames, count: int) -> float:
    """The largest such difference between `count` of the environment's pictures and the others."""
    count = min(count, len(environment) // 2)
    groups = (np.arange(start, start + count) for start in range(0, len(environment) - count + 1, count))
    return max(
        _scene_difference(environment[group], np.delete(environment, group, axis=0)) for group in groups
    )


def _labelled(rows: list[tuple[str, list[Frame]]]) -> Image.Image:
    size = rows[0][1][0].shape[0]
    size *= -(-_SMALLEST_PICTURE // size)
    columns = max(len(pictures) for _, pictures in rows)
    width = max(columns * (size + _GAP), 3 * (size + _GAP)) + _GAP
    sheet = Image.new("RGB", (width, len(rows) * (size + _LABEL + _GAP) + _GAP), "white")
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(size=14)
    for row, (label, pictures) in enumerate(rows):
        top = _GAP + row * (size + _LABEL + _GAP)
        draw.text((_GAP, top), label, fill="black", font=font)
        for column, picture in enumerate(pictures):
            enlarged = Image.fromarray(picture).resize((size, size), Image.Resampling.NEAREST)
            sheet.paste(enlarged, (_GAP + column * (size + _GAP), top + _LABEL))
    return sheet
