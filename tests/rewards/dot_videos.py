"""Videos so simple that a reward model can tell their two kinds apart after some tens of steps."""

from __future__ import annotations

import numpy as np

from bootifol.types import FrameBatch, Video

SIZE = 32
FRAMES = 12


class DotVideos:
    """A bright dot on a dark ground that moves right, or (`jumps`) to a random place every frame."""

    def __init__(
        self, name: str, jumps: bool, count: int = 8, size: int = SIZE, frames: int = FRAMES
    ) -> None:
        rng = np.random.default_rng(7)
        self.name = name
        self.videos = rng.integers(0, 40, (count, frames, size, size, 3), dtype=np.uint8)
        for video in self.videos:
            x, y = rng.integers(0, size // 2, 2)
            for t, frame in enumerate(video):
                if jumps:
                    x, y = rng.integers(0, size - 4, 2)
                column = x if jumps else (x + t) % size
                frame[y : y + 4, column : column + 4] = (250, 120, 30)

    def __len__(self) -> int:
        return len(self.videos)

    def __getitem__(self, index: int) -> Video:
        return Video(f"{self.name}-{index}", self.videos[index])

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self.videos[rng.choice(len(self.videos), count, replace=False)]


EXPERT = DotVideos("expert", jumps=False)
OTHER = DotVideos("other", jumps=True)
