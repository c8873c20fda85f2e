"""Videos read at once, as tests compare them; the library streams them."""

from pathlib import Path

import numpy as np

from bootifol.types import Frames
from bootifol.video_files.reading import stream_video


def read_video(path: Path) -> Frames:
    """All pictures of a video, uint8 `[frames, H, W, 3]`; errors as `stream_video`."""
    return np.stack([timed.frame for timed in stream_video(path)])
