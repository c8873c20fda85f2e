"""Videos in memory, as a source for reward models."""

from __future__ import annotations

import numpy as np

from bootifol.types import FrameBatch, Video


class ArrayVideos:
    """`videos` `[N, T + 1, H, W, 3]`, named `<name>-<index>`."""

    def __init__(self, name: str, videos: FrameBatch) -> None:
        self.name = name
        self.videos = videos

    def __len__(self) -> int:
        return len(self.videos)

    def __getitem__(self, index: int) -> Video:
        return Video(f"{self.name}-{index}", self.videos[index])

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self.videos[rng.choice(len(self.videos), count, replace=False)]
