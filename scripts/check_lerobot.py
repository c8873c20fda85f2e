"""Loads a set of `demos export --format lerobot` with LeRobot and compares it with the arrays of `--format npy`.

Run by check_lerobot.sh, in an environment that has LeRobot and not bootifol.
"""

import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset

ROUNDING = 2.5
"""Levels of 255 by which a pixel may differ: what the export promises is two, and a half for LeRobot's own floats."""


def check(lerobot: Path, arrays: Path) -> None:
    """Compares a LeRobot dataset, frame by frame, with a folder of arrays of the same videos."""
    dataset = LeRobotDataset("bootifol/check", root=lerobot, video_backend="pyav")
    videos = [np.load(file) for file in sorted(arrays.glob("*.npy"))]
    assert dataset.num_episodes == len(videos), (dataset.num_episodes, len(videos))
    assert len(dataset) == sum(map(len, videos)), (len(dataset), [len(video) for video in videos])
    worst, index = 0.0, 0
    for episode, video in enumerate(videos):
        for frame, picture in enumerate(video):
            item = dataset[index]
            assert int(item["episode_index"]) == episode and int(item["frame_index"]) == frame
            assert abs(float(item["timestamp"]) - frame / dataset.fps) < 1e-4
            shown = item["observation.image"].permute(1, 2, 0).numpy() * 255
            assert shown.shape == picture.shape, (shown.shape, picture.shape)
            worst = max(worst, float(np.abs(shown - picture).max()))
            index += 1
    assert worst <= ROUNDING, f"a pixel differs by {worst:.1f} levels of 255"
    batch = next(iter(torch.utils.data.DataLoader(dataset, batch_size=4, shuffle=True)))
    assert batch["observation.image"].shape[0] == 4
    mean = dataset.meta.stats["observation.image"]["mean"].reshape(3) * 255
    true = np.concatenate(videos).reshape(-1, 3).mean(0)
    assert np.abs(mean - true).max() < 0.5, (mean, true)
    print(
        f"LeRobot {version('lerobot')} reads it: {dataset.num_episodes} episodes, {len(dataset)} frames "
        f"at {dataset.fps} a second, task {item['task']!r}; pixels differ by {worst:.1f} levels of 255 at most"
    )


if __name__ == "__main__":
    check(Path(sys.argv[1]), Path(sys.argv[2]))
