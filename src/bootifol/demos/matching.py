"""Brings videos toward the environment's own pictures: crop, colors, exposure, background.

All is fitted on median pictures, in which what moves does not show: `fit` says what to do, `Match` does it to a video.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bootifol.errors import BootifolError
from bootifol.types import Frame, Frames

Repair = Literal["crop", "colors", "exposure", "background"]
"""crop: a square of the pictures. colors: gain and offset of each channel, for light and white balance. exposure:
gains that change within a video. background: what stands still gives way to what the environment shows there."""

REPAIRS: tuple[Repair, ...] = get_args(Repair)

SCALES = np.arange(1.0, 0.69, -0.02)
"""Sides of the squares that are tried, as fractions of the picture's."""

PLACES = 7
"""Places along each axis that are tried for each side, first all over, then around the best."""

WORTH_A_CROP = 0.85
"""A crop must leave less than this fraction of the difference, for it costs sharpness."""

TRIMMED = 0.75
"""Fraction of the pixels that a fit believes: the others may show what moved."""

GAINS = (0.4, 2.5)
"""Least and largest gain of a channel."""

STEADY_DRIFT = 0.02
"""Exposure that changes less within videos (standard deviation of the gain) is left alone."""

SAME_PLACE = (10.0, 26.0)
"""Levels of 255: what differs by less from the usual picture is background, by more it is not, between them a blend."""

MOST_EXCHANGED = 40.0
"""Levels of 255 by which a background may differ from the environment's and still be the same place."""

Picture = NDArray[np.float32]
"""float32 `[H, W, 3]`, levels of 255."""

Channels = tuple[float, float, float]
"""A number for red, green and blue."""


@dataclass(frozen=True)
class Match:
    """What to do to videos; the identity where nothing was to be done."""

    size: int
    """Height and width of the pictures."""

    crop: tuple[int, int, int] | None = None
    """Left edge, top edge and side of the square that is enlarged to the whole."""

    gain: Channels = (1.0, 1.0, 1.0)
    offset: Channels = (0.0, 0.0, 0.0)
    """Of red, green and blue, after the crop: level · gain + offset."""

    usual: Picture | None = None
    """What videos mostly show after crop and colors; each frame's exposure is brought to it. None: it is steady."""

    background: tuple[Picture, Picture] | None = None
    """The videos' background and the environment's in its place; None: it is left alone."""

    def __call__(self, frames: Frames) -> Frames:
        """A video after the repairs, uint8 `[n, H, W, 3]`."""
        if self.changes_nothing:
            return frames
        shown = _affine(self.cropped(frames), self.gain, self.offset)
        if self.usual is not None:
            shown = shown * _gains_toward(self.usual, shown)[:, None, None, :]
        if self.background is not None:
            shown = _exchanged(shown, *self.background)
        levels: Frames = shown.round().clip(0, 255).astype(np.uint8)
        return levels

    @property
    def changes_nothing(self) -> bool:
        plain = Match(self.size)
        numbers = (self.crop, self.gain, self.offset) == (plain.crop, plain.gain, plain.offset)
        return numbers and self.usual is None and self.background is None

    def cropped(self, frames: Frames) -> NDArray[np.float32]:
        """The square of each picture, float32 `[n, H, W, 3]`."""
        if self.crop is None:
            return frames.astype(np.float32)
        return np.stack([_square(frame, self.crop) for frame in frames])

    def described(self) -> dict[str, Any]:
        """For the manifest; the pictures stand beside it."""
        return {
            "crop": None if self.crop is None else list(self.crop),
            "gain": [round(value, 4) for value in self.gain],
            "offset": [round(value, 2) for value in self.offset],
            "exposure": self.usual is not None,
            "background": self.background is not None,
        }


def fit(
    first_frames: Frames,
    videos: Iterator[Frames],
    environment_first: Frames,
    environment: Frames,
    repairs: Collection[Repair] = REPAIRS,
) -> Match:
    """What brings videos toward an environment.

    Args:
        first_frames: of the videos, uint8 `[n, H, W, 3]`.
        videos: some of them, whole, uint8 `[m, H, W, 3]`.
        environment_first: how it looks at the start of episodes, uint8 `[k, H, W, 3]`.
        environment: pictures of it while somebody acts, uint8 `[l, H, W, 3]`.
        repairs: which may be made; only those are that bring the pictures nearer.

    Raises:
        BootifolError: there is nothing to repair.
    """
    if not repairs:
        raise BootifolError(f"name at least one repair: {', '.join(REPAIRS)}")
    goal = _median(environment_first)
    match = Match(size=first_frames.shape[1])
    found = _median(first_frames)
    if "crop" in repairs:
        match = _with_crop(match, found, goal, "colors" in repairs)
    if "colors" in repairs:
        # Pictures must agree in place before their levels can; where they do not, only the spread of levels is used.
        gain, offset = _levels(_square(found, match.crop), goal)
        match = replace(match, gain=gain, offset=offset)
    shown = [match(video) for video in videos]
    usual = _median(np.concatenate([video[:: max(1, len(video) // 8)] for video in shown]))
    if "exposure" in repairs:
        gains = [_gains_toward(usual, video.astype(np.float32)) for video in shown]
        if max(float(gain.std(axis=0).max()) for gain in gains) > STEADY_DRIFT:
            match = replace(match, usual=usual)
    if "background" in repairs:
        there = _median(environment)
        after = _exchanged(usual[None], usual, there)[0]
        if np.abs(after - there).mean() < 0.9 * np.abs(usual - there).mean():
            match = replace(match, background=(usual, there))
    return match


def difference(left: Frames, right: Frames) -> float:
    """Mean absolute difference of two median pictures, in levels of 255."""
    return float(np.abs(_median(left) - _median(right)).mean())


def _with_crop(match: Match, found: Picture, goal: Picture, colors_too: bool) -> Match:
    """The square of the videos that is most like the environment, whatever the light, if it is worth it."""

    def left_over(crop: tuple[int, int, int] | None) -> float:
        square = _square(found, crop)
        if colors_too:
            gain, offset = _regression(square, goal)
            square = _affine(square, gain, offset)
        return float(np.abs(square - goal).mean())

    size = match.size
    best: tuple[int, int, int] | None = None
    least = WORTH_A_CROP * left_over(None)
    for scale in SCALES[1:]:
        side = round(size * float(scale))
        places = np.unique(np.linspace(0, size - side, PLACES).round().astype(int))
        for top in places:
            for left in places:
                now = left_over((int(left), int(top), side))
                if now < least:
                    best, least = (int(left), int(top), side), now
    if best is not None:
        left, top, side = best
        near = range(-2, 3)
        tried = [
            (left + x, top + y, side + s)
            for x in near
            for y in near
            for s in near
            if min(left + x, top + y) >= 0 and max(left + x, top + y) + side + s <= size
        ]
        best = min(tried, key=left_over)
    return replace(match, crop=best)


def _levels(found: Picture, goal: Picture) -> tuple[Channels, Channels]:
    """Gain and offset of each channel: by pixels where they lie alike, otherwise by mean and spread."""
    alike = min(
        float(np.corrcoef(found[..., channel].ravel(), goal[..., channel].ravel())[0, 1])
        if found[..., channel].std() > 1 and goal[..., channel].std() > 1
        else 1.0
        for channel in range(3)
    )
    if alike > 0.8:
        return _regression(found, goal)
    spread = goal.std((0, 1)) / np.maximum(found.std((0, 1)), 1.0)
    gain = spread.clip(*GAINS)
    return _channels(gain), _channels(goal.mean((0, 1)) - gain * found.mean((0, 1)))


def _regression(found: Picture, goal: Picture) -> tuple[Channels, Channels]:
    """Gain and offset of each channel by least squares, twice: the second time without what fitted worst."""
    believed = np.ones(found.shape[:2], bool)
    gain, offset = np.ones(3), np.zeros(3)
    for _ in range(2):
        left, right = found[believed].astype(np.float64), goal[believed].astype(np.float64)
        centered = left - left.mean(0)
        spread = (centered**2).mean(0)
        slope = (centered * (right - right.mean(0))).mean(0) / np.maximum(spread, 1e-6)
        # Where what fits best has no contrast, it tells no gain.
        gain = np.where(spread > 4.0, slope, gain).clip(*GAINS)
        offset = right.mean(0) - gain * left.mean(0)
        error = np.abs(found * gain + offset - goal).max(-1)
        believed = error <= np.quantile(error, TRIMMED)
    return _channels(gain), _channels(offset)


def _channels(values: NDArray[np.floating[Any]]) -> Channels:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def _affine(pictures: NDArray[np.float32], gain: Channels, offset: Channels) -> NDArray[np.float32]:
    return pictures * np.array(gain, np.float32) + np.array(offset, np.float32)


def _gains_toward(usual: Picture, frames: NDArray[np.float32]) -> NDArray[np.float32]:
    """What to multiply each frame's channels by so that it is exposed like the usual picture, float32 `[n, 3]`."""
    gains = np.ones((len(frames), 3), np.float32)
    for frame, gain in zip(frames, gains, strict=True):
        believed = np.ones(usual.shape[:2], bool)
        for _ in range(3):
            left, right = frame[believed], usual[believed]
            gain[:] = ((left * right).sum(0) / np.maximum((left**2).sum(0), 1.0)).clip(0.5, 2.0)
            error = np.abs(frame * gain - usual).max(-1)
            believed = error <= np.quantile(error, TRIMMED)
    return gains


def _exchanged(frames: NDArray[np.float32], usual: Picture, there: Picture) -> NDArray[np.float32]:
    """Frames in which what looks like the usual picture gives way to what the environment shows there."""
    near, far = SAME_PLACE
    same_place = (np.abs(usual - there).max(-1) <= MOST_EXCHANGED).astype(np.float32)
    differing = np.abs(frames - usual).max(-1)
    # Edges of what moves belong to it: the largest difference among a pixel and its neighbors counts.
    padded = np.pad(differing, ((0, 0), (1, 1), (1, 1)), mode="edge")
    height, width = usual.shape[:2]
    around = np.max([padded[:, y : y + height, x : x + width] for y in range(3) for x in range(3)], axis=0)
    kept = 1.0 - (1.0 - ((around - near) / (far - near)).clip(0, 1)) * same_place
    blended: NDArray[np.float32] = frames * kept[..., None] + there * (1.0 - kept[..., None])
    return blended


def _square(picture: Frame | Picture, crop: tuple[int, int, int] | None) -> Picture:
    if crop is None:
        return picture.astype(np.float32)
    left, top, side = crop
    size = picture.shape[0]
    inside = np.ascontiguousarray(picture[top : top + side, left : left + side].astype(np.float32))
    enlarged = [
        Image.fromarray(inside[..., channel]).resize((size, size), Image.Resampling.BICUBIC)
        for channel in range(3)
    ]
    return np.stack([np.asarray(channel, np.float32) for channel in enlarged], axis=-1)


def _median(frames: Frames) -> Picture:
    median: Picture = np.median(frames, axis=0).astype(np.float32)
    return median
