"""One picture that shows what is in a demo set: a video a row, time to the right."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from PIL import Image

from bootifol.files import written_aside
from bootifol.types import Frame, FrameBatch, VideoSource

CONTACT_SHEET_NAME = "contact_sheet.png"
_GAP = 2
_SMALLEST_PICTURE = 96


def contact_sheet(videos: FrameBatch, columns: int = 10) -> Frame:
    """Evenly spaced pictures of each video, first and last included.

    Args:
        videos: uint8 `[rows, T + 1, H, W, 3]`.
        columns: pictures a row (fewer when the videos are shorter).

    Returns:
        uint8 `[height, width, 3]`; small pictures are enlarged by a whole factor.
    """
    rows, frames, height, width, _ = videos.shape
    chosen = np.unique(np.linspace(0, frames - 1, columns).round().astype(int))
    factor = math.ceil(_SMALLEST_PICTURE / max(height, width))
    height, width = height * factor, width * factor
    sheet = np.full((rows * (height + _GAP) + _GAP, len(chosen) * (width + _GAP) + _GAP, 3), 255, np.uint8)
    for row in range(rows):
        for column, frame in enumerate(chosen):
            top, left = _GAP + row * (height + _GAP), _GAP + column * (width + _GAP)
            picture = videos[row, frame].repeat(factor, axis=0).repeat(factor, axis=1)
            sheet[top : top + height, left : left + width] = picture
    return sheet


def write_contact_sheet(directory: Path, videos: VideoSource, rows: int = 8) -> Path:
    """Writes `contact_sheet.png` beside a set's shards: up to `rows` videos, spread over the whole set."""
    chosen = np.unique(np.linspace(0, len(videos) - 1, rows).round().astype(int))
    sheet = contact_sheet(np.stack([videos[int(index)].frames for index in chosen]))
    target = directory / CONTACT_SHEET_NAME
    with written_aside(target) as aside:
        Image.fromarray(sheet).save(aside, format="png")
    return target
