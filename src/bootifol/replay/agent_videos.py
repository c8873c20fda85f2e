"""The agent's own videos, D_a of the paper's Algorithm 1: the newest whole episodes, in memory."""

from __future__ import annotations

import json

import numpy as np

from bootifol.demos.demo_set import draw
from bootifol.errors import BootifolError
from bootifol.types import Arrays, FeatureBatch, FrameBatch, Video


class AgentVideos:
    """A ring of the newest `capacity` episodes of the agent; a `FeatureSource`.

        slot        0    1    2    3   …   capacity-1
        video       7    8    3    4   …              next add overwrites the oldest (3)

    Where the reward model reads features, these are kept and the pictures are not: its videos then have pictures of
    0x0 pixels.

    The environment's rewards of a video are not kept: nothing that learns from these videos may read them.
    """

    def __init__(
        self,
        capacity: int,
        frames: int,
        size: int,
        feature_size: int = 0,
        feature_bytes: int = 4,
    ) -> None:
        """Reserves the memory (the system hands it out as episodes arrive).

        Args:
            capacity: episodes kept (5000 in the paper).
            frames: frames of an episode, T + 1; a shorter episode stands still on its last frame.
            size: height and width of a frame in pixels.
            feature_size: features of a frame, kept instead of its pixels; 0 keeps the pixels.
            feature_bytes: 4 for float32 features, 1 for int8 states.
        """
        if capacity < 1:
            raise BootifolError(f"the agent's videos need room for at least 1 episode, not {capacity}")
        size = 0 if feature_size else size
        self._frames: FrameBatch = np.zeros((capacity, frames, size, size, 3), np.uint8)
        shape = (capacity, frames, feature_size)
        self._features: FeatureBatch = (
            np.zeros(shape, np.float32) if feature_bytes == 4 else np.zeros(shape, np.int8)
        )
        self._names: list[str] = []
        self._next = 0

    @staticmethod
    def bytes_needed(
        capacity: int, frames: int, size: int, feature_size: int = 0, feature_bytes: int = 4
    ) -> int:
        """Memory of a full ring, in bytes."""
        return capacity * frames * (feature_bytes * feature_size or size * size * 3)

    def add(self, video: Video) -> None:
        """Keeps a video, in the place of the oldest one when full.

        Raises:
            BootifolError: the video is longer than the ring's episodes, or its pictures or features have another size.
        """
        frames = video.frames if self._keeps_pixels else video.frames[:, :0, :0]
        if frames.shape[1:] != self._frames.shape[2:] or not 1 <= len(frames) <= self._frames.shape[1]:
            raise BootifolError(
                f"the video {video.name} is {list(frames.shape)} and the agent's videos are "
                f"{list(self._frames.shape[1:])}: make the video size and the episode length agree"
            )
        slot = self._frames[self._next]
        slot[: len(frames)] = frames
        slot[len(frames) :] = frames[-1]
        if not self._keeps_pixels:
            self._add_features(video)
        if len(self._names) < len(self._frames):
            self._names.append(video.name)
        else:
            self._names[self._next] = video.name
        self._next = (self._next + 1) % len(self._frames)

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, index: int) -> Video:
        """The video in a slot; slots are not in order of age once the ring is full."""
        if not 0 <= index < len(self):
            raise IndexError(f"video {index} of {len(self)}")
        features = None if self._keeps_pixels else self._features[index].copy()
        return Video(self._names[index], self._frames[index].copy(), features=features)

    def newest(self, count: int) -> list[Video]:
        """The newest `count` videos, or all if there are fewer; oldest first."""
        count = min(count, len(self))
        return [self[self.slot_of(age)] for age in reversed(range(count))]

    def slot_of(self, age: int) -> int:
        """The slot of a video that so many others are newer than, 0 for the newest.

        Raises:
            IndexError: there are not as many videos.
        """
        if not 0 <= age < len(self):
            raise IndexError(f"the {age}th newest of {len(self)} videos, counted from 0")
        return (self._next - 1 - age) % len(self._frames)

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self._frames[draw(len(self), count, rng)]

    def sample_features(self, count: int, rng: np.random.Generator) -> FeatureBatch:
        return self._features[draw(len(self), count, rng)]

    def state(self) -> Arrays:
        """Frames or features, names and the next slot; the former are a view, to be written before the next `add`."""
        return {
            self._kept_name: self._kept[: len(self)],
            "names": np.frombuffer(json.dumps(self._names).encode(), np.uint8),
            "next": np.array([self._next], np.int64),
        }

    def load_state(self, arrays: Arrays) -> None:
        """Continues from `state()` of a ring of the same capacity and size.

        Raises:
            BootifolError: the arrays come from a ring of another size.
        """
        saved, kept = arrays[self._kept_name], self._kept
        if saved.shape[1:] != kept.shape[1:] or len(saved) > len(kept):
            raise BootifolError(
                f"the saved agent videos are {list(saved.shape)} and this run keeps "
                f"{list(kept.shape)}: resume with the configuration of the run that saved them"
            )
        kept[: len(saved)] = saved
        self._names = json.loads(arrays["names"].tobytes())
        self._next = int(arrays["next"][0])

    @property
    def _keeps_pixels(self) -> bool:
        return self._features.size == 0

    @property
    def _kept_name(self) -> str:
        return "frames" if self._keeps_pixels else "features"

    @property
    def _kept(self) -> FrameBatch | FeatureBatch:
        return self._frames if self._keeps_pixels else self._features

    def _add_features(self, video: Video) -> None:
        expected = (len(video.frames), self._features.shape[2])
        found = None if video.features is None else video.features.shape
        if video.features is None or found != expected:
            raise BootifolError(
                f"the video {video.name} has {'no features' if found is None else f'features {list(found)}'} and the "
                f"agent's videos are kept as {expected[1]} features a frame: compute them with the run's backbone or "
                "eyes"
            )
        slot = self._features[self._next]
        slot[: len(video.features)] = video.features
        slot[len(video.features) :] = video.features[-1]
