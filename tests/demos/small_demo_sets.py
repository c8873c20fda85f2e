"""Small demo sets, written without any simulator."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from bootifol.demos.manifest import Manifest, VideoEntry, write_manifest
from bootifol.demos.shards import sha256_of_frames, write_shard

FRAMES = 5
SIZE = 8


def moving_videos(count: int, seed: int = 0) -> np.ndarray:
    """Random pictures, all different: uint8 `[count, 5, 8, 8, 3]`."""
    return np.random.default_rng(seed).integers(0, 256, (count, FRAMES, SIZE, SIZE, 3), np.uint8)


WriteSet = Callable[..., Path]


def set_writer(root: Path) -> WriteSet:
    """A function that writes a complete set of `videos`, `per_shard` a file, and returns its directory."""

    def write(videos: np.ndarray, name: str = "drawn-expert", per_shard: int = 3, **fields: object) -> Path:
        directory = root / name
        directory.mkdir()
        shards = [
            write_shard(directory, index, videos[first : first + per_shard])
            for index, first in enumerate(range(0, len(videos), per_shard))
        ]
        values: dict[str, object] = {
            "name": name,
            "complete": True,
            "task": "drawn_reach",
            "behavior": "expert",
            "seed": 1,
            "episodes": len(videos),
            "frames": FRAMES,
            "video_size": SIZE,
            "agent_size": SIZE,
            "render_profile": "fast",
            "action_repeat": 1,
            "frames_per_second": 25.0,
            "conversion": None,
            "versions": {},
            "shards": tuple(shards),
            "videos": tuple(
                VideoEntry(
                    name=f"{name}-{index:06d}",
                    source={"behavior": "expert", "seed": index},
                    length=FRAMES,
                    sha256=sha256_of_frames(frames),
                )
                for index, frames in enumerate(videos)
            ),
        }
        write_manifest(directory, Manifest(**(values | fields)))  # type: ignore[arg-type]
        return directory

    return write
