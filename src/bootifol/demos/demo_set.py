"""The on-disk demo set, and views of it: where every learner gets its videos from."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from bootifol.checksums import require_as_written
from bootifol.demos.manifest import MANIFEST_NAME, Manifest, read_manifest
from bootifol.demos.shards import open_shard, sha256_of_file, sha256_of_frames
from bootifol.errors import BootifolError
from bootifol.progress import progress
from bootifol.types import FrameBatch, Video


class DemoSet:
    """Videos of one length and size in a directory; read one by one, so that a set may exceed the memory.

    It is a `VideoSource`. All checks that cost nothing run on opening; `verify` also reads every byte.
    """

    def __init__(self, path: Path, manifest: Manifest) -> None:
        """Opens the shards that `manifest` lists; use `DemoSet.open` for a directory."""
        self.path = path
        self.manifest = manifest
        firsts = itertools.accumulate((shard.videos for shard in manifest.shards), initial=0)
        shards = zip(manifest.shards, firsts, strict=False)
        self._shards = [open_shard(path, shard, manifest, first) for shard, first in shards]
        self._places = [
            (shard, row) for shard, opened in enumerate(self._shards) for row in range(opened.videos)
        ]

    @classmethod
    def open(cls, path: Path | str, verify: bool = False) -> DemoSet:
        """Opens a complete demo set.

        Args:
            path: its directory.
            verify: also compare every checksum.

        Raises:
            BootifolError: something is missing, of the wrong size or damaged, or the recording is unfinished.
        """
        path = Path(path)
        if not path.is_dir():
            raise BootifolError(
                f"there is no demo set at {path}: record one with `bootifol demos record --out {path}`"
            )
        manifest = read_manifest(path)
        if not manifest.complete:
            raise BootifolError(
                f"the demo set {path} is unfinished ({len(manifest.videos)} of {manifest.episodes} videos): "
                "run the command that records it once more and it goes on where it stopped"
            )
        demo_set = cls(path, manifest)
        if verify:
            demo_set.verify()
        return demo_set

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, index: int) -> Video:
        if not 0 <= index < len(self):
            raise IndexError(f"video {index} of {len(self)}")
        return Video(self.manifest.videos[index].name, self.gather([index])[0])

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self.gather(draw(len(self), count, rng))

    def gather(self, indices: Sequence[int]) -> FrameBatch:
        """The frames of these videos, uint8 `[len(indices), T + 1, H, W, 3]`; only they are read."""
        size = self.manifest.video_size
        batch = np.empty((len(indices), self.manifest.frames, size, size, 3), np.uint8)
        for place, index in enumerate(indices):
            shard, row = self._places[index]
            self._shards[shard].read(row, batch[place])
        return batch

    def split(self, held_out: int, seed: int = 0) -> tuple[VideoSubset, VideoSubset]:
        """Two views without a video in common: `(training, held_out)`.

        Sets of the same number of videos that were recorded with the same seed hold out the same starts.

        Raises:
            BootifolError: nothing would be left to train on.
        """
        if not 0 <= held_out < len(self):
            raise BootifolError(
                f"{held_out} videos cannot be held out of the {len(self)} in {self.path}: "
                "record more, or hold out fewer"
            )
        order = np.random.default_rng(seed).permutation(len(self))
        return (
            VideoSubset(self, sorted(int(index) for index in order[held_out:])),
            VideoSubset(self, sorted(int(index) for index in order[:held_out])),
        )

    def verify(self) -> None:
        """Reads every byte and compares every checksum: the manifest's, and those of all files.

        Raises:
            BootifolError: naming the file, and the videos in it that differ.
        """
        with progress(f"verifying {self.manifest.name}", total=len(self)) as advance:
            for videos in self.verified_shards():
                advance(videos)

    def verified_shards(self) -> Iterator[int]:
        """The same shard by shard, and without a word.

        Yields:
            How many videos were found to be whole, each time.
        """
        require_as_written(self.path / MANIFEST_NAME, "the demo set's manifest")
        first = 0
        for shard in self.manifest.shards:
            damaged = [
                self.manifest.videos[index].name
                for index in range(first, first + shard.videos)
                if sha256_of_frames(self[index].frames) != self.manifest.videos[index].sha256
            ]
            if damaged:
                raise BootifolError(
                    f"{self.path / shard.file} is damaged: the pixels of {listed(damaged)} are not "
                    "the ones recorded; restore the file or record the set again"
                )
            if sha256_of_file(self.path / shard.file) != shard.sha256:
                raise BootifolError(
                    f"{self.path / shard.file} is damaged: its checksum is not the manifest's, though "
                    "its videos are whole; restore the file or record the set again"
                )
            first += shard.videos
            yield shard.videos


class VideoSubset:
    """Some videos of a demo set, as a `VideoSource`."""

    def __init__(self, demo_set: DemoSet, indices: Sequence[int]) -> None:
        self.demo_set = demo_set
        self.indices = indices

    def __len__(self) -> int:
        return len(self.indices)

    def __getitem__(self, index: int) -> Video:
        return self.demo_set[self.indices[index]]

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self.demo_set.gather([self.indices[chosen] for chosen in draw(len(self), count, rng)])


def draw(total: int, count: int, rng: np.random.Generator) -> list[int]:
    """`count` numbers below `total`, uniformly; without repetition unless `count` exceeds `total`."""
    if total == 0:
        raise BootifolError("there are no videos to draw from")
    return [int(index) for index in rng.choice(total, size=count, replace=count > total)]


def listed(names: Sequence[str], most: int = 5) -> str:
    """Names for a sentence, the first few when there are many."""
    shown = ", ".join(names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown
