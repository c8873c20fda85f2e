"""Picture files with several frames, as Pillow reads them: animated webp, png and avif, and stacks in one tiff."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from PIL import Image, ImageSequence

from bootifol.errors import BootifolError
from bootifol.video_files.orientation import TimedFrame, upright_picture

_LONGEST_SIDE, _MOST_PIXELS = 2**14, 2**26
"""Of a picture; larger ones are damaged headers."""

_UNSAID = 0.1
"""Seconds that a frame shows which says 0, as in a GIF."""


def stream_animation(path: Path) -> Iterator[TimedFrame]:
    """Reads every frame with its time, or without where the file tells none.

    Raises:
        BootifolError: the file is damaged; at the latest at its end.
    """
    clock = 0.0
    count = 0
    size: tuple[int, ...] | None = None
    try:
        with Image.open(path) as picture:
            if max(picture.size) > _LONGEST_SIDE or picture.width * picture.height > _MOST_PIXELS:
                raise BootifolError(
                    f"{path} says that its pictures have {picture.width}×{picture.height} pixels: it is damaged, or "
                    "too large for a video"
                )
            frames = ImageSequence.Iterator(picture)
            if getattr(picture, "default_image", False):
                next(frames)  # for programs that show no animations
            for frame in frames:
                shown = upright_picture(frame.copy())
                milliseconds = frame.info.get("duration")
                lasts = milliseconds / 1000 or _UNSAID if isinstance(milliseconds, int | float) else None
                if size not in (None, shown.shape):
                    raise BootifolError(
                        f"{path} holds pictures of several sizes, so it is no video: save the frames alone"
                    )
                size = shown.shape
                yield TimedFrame(shown, None if lasts is None else clock, lasts)
                clock += lasts or 0.0
                count += 1
    except BootifolError:
        raise
    except Exception as error:  # damaged ones make Pillow raise anything
        raise BootifolError(
            f"{path} is damaged or truncated: {count} pictures could be read ({error}); copy or export it again"
        ) from error
