"""One picture that shows what is in a demo set: a video a row, time to the right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from bootifol.demos.demo_set import DemoSet
from bootifol.files import written_aside
from bootifol.types import Frame, FrameBatch

CONTACT_SHEET_NAME = "contact_sheet.png"
_GAP = 4
_LABEL = 18
_SMALLEST_PICTURE = 96
_BORDER = (110, 110, 110)
_GROUND = 255


def contact_sheet(videos: FrameBatch, names: Sequence[str], columns: int = 10) -> Frame:
    """Evenly spaced pictures of each video, first and last included, each in a gray border, below the video's name.

    Args:
        videos: uint8 `[rows, T + 1, H, W, 3]`.
        names: of the videos.
        columns: pictures a row (fewer when the videos are shorter).

    Returns:
        uint8 `[height, width, 3]`; small pictures are enlarged by a whole factor.
    """
    rows, frames, height, width, _ = videos.shape
    chosen = np.unique(np.linspace(0, frames - 1, columns).round().astype(int))
    factor = math.ceil(_SMALLEST_PICTURE / max(height, width))
    height, width = height * factor, width * factor
    row_height = _LABEL + height + _GAP
    size = (len(chosen) * (width + _GAP) + _GAP, rows * row_height + _GAP)
    sheet = Image.new("RGB", size, (_GROUND, _GROUND, _GROUND))
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(size=12)
    for row, name in enumerate(names):
        top = row * row_height + _LABEL
        draw.text((_GAP, top - _LABEL + 2), name, fill=(0, 0, 0), font=font)
        for column, frame in enumerate(chosen):
            left = _GAP + column * (width + _GAP)
            draw.rectangle((left - 1, top - 1, left + width, top + height), outline=_BORDER)
            picture = videos[row, frame].repeat(factor, axis=0).repeat(factor, axis=1)
            sheet.paste(Image.fromarray(picture), (left, top))
    return np.asarray(sheet)


def write_contact_sheet(directory: Path, videos: DemoSet, rows: int = 8) -> Path:
    """Writes `contact_sheet.png` beside a set's shards: up to `rows` videos, spread over the whole set."""
    chosen = np.unique(np.linspace(0, len(videos) - 1, rows).round().astype(int))
    names = [videos.manifest.videos[index].described for index in chosen]
    sheet = contact_sheet(np.stack([videos[int(index)].frames for index in chosen]), names)
    target = directory / CONTACT_SHEET_NAME
    with written_aside(target) as aside:
        Image.fromarray(sheet).save(aside, format="png")
    return target
