"""Features of a demo set's videos, computed once for a frozen network and kept beside the videos.

    DEMOS/expert/features/efficientnet_lite0-224-fp32-5a0c…/    network, size, precision, checksum of the weights
      1f8e….safetensors                 one video, by the checksum of its pixels: float32 [T + 1, F]

A video's features are found by the checksum that the manifest gives its pixels, so other pixels never get them. Each
file is written aside and renamed: whoever stops and starts again goes on at the first video that has none. Only the
videos of a batch are read, so a set may exceed the memory.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Protocol, cast

import numpy as np

from bootifol.demos.demo_set import VideoSubset, draw
from bootifol.demos.shards import sha256_of_frames
from bootifol.errors import BootifolError
from bootifol.files import read_arrays, write_arrays
from bootifol.progress import progress
from bootifol.types import FeatureBatch, Features, FrameBatch, Frames, Video

_NAME = "features"


class Featurizer(Protocol):
    """A frozen network."""

    @property
    def key(self) -> str:
        """A name for files: equal only where all features are equal."""
        ...

    feature_size: int

    def features(self, frames: Frames) -> Features:
        """`[N, S, S, 3]` to `[N, F]`."""
        ...


class FeaturizedVideos:
    """Videos of a demo set with their features; a `FeatureSource`.

    Args:
        videos: see there.
        featurizer: what computes the features that are not on disk yet, when they are asked for.
    """

    def __init__(self, videos: VideoSubset, featurizer: Featurizer) -> None:
        self.videos = videos
        self.featurizer = featurizer
        self.directory = videos.demo_set.path / _NAME / featurizer.key

    def __len__(self) -> int:
        return len(self.videos)

    def __getitem__(self, index: int) -> Video:
        return replace(self.videos[index], features=self._features(index))

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self.videos.sample(count, rng)

    def sample_features(self, count: int, rng: np.random.Generator) -> FeatureBatch:
        return np.stack([self._features(index) for index in draw(len(self), count, rng)])

    def compute(self) -> None:
        """Computes the features of every video that has none yet.

        Raises:
            BootifolError: they cannot be written, or the pixels of a video are not the ones recorded.
        """
        missing = [index for index in range(len(self)) if not self._path(index).is_file()]
        if not missing:
            return
        name = self.videos.demo_set.manifest.name
        with progress(f"features of {name} (videos)", len(self), len(self) - len(missing)) as advance:
            for index in missing:
                self._compute(index)
                advance(1)

    def _path(self, index: int) -> Path:
        entry = self.videos.demo_set.manifest.videos[self.videos.indices[index]]
        return self.directory / f"{entry.sha256}.safetensors"

    def _features(self, index: int) -> Features:
        """`[T + 1, F]`."""
        path = self._path(index)
        if not path.is_file():
            return self._compute(index)
        stored = read_arrays(path, "the features of a video").get(_NAME)
        expected = (self.videos.demo_set.manifest.frames, self.featurizer.feature_size)
        if stored is None or stored.shape != expected or stored.dtype != np.float32:
            raise BootifolError(
                f"{path} does not hold float32 features {list(expected)}; remove it, and they are computed again"
            )
        return cast(Features, stored)

    def _compute(self, index: int) -> Features:
        video, path = self.videos[index], self._path(index)
        if sha256_of_frames(video.frames) != path.stem:
            raise BootifolError(
                f"the pixels of {video.name} in {self.videos.demo_set.path} are not the ones recorded; restore the "
                "files or record the set again"
            )
        features = self.featurizer.features(video.frames)
        write_arrays(path, {_NAME: features})
        return features


def without_pixels(videos: Iterable[Video]) -> list[Video]:
    """Videos with their features alone, which take a hundredth of the memory: their frames have 0x0 pixels."""
    return [replace(video, frames=np.empty((len(video.frames), 0, 0, 3), np.uint8)) for video in videos]
