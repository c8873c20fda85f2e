"""`bootifol score`: the learned reward along any video."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table


def score(
    run: Annotated[Path, tyro.conf.Positional],
    videos: Annotated[list[Path], tyro.conf.Positional],
    out: Path | None = None,
) -> int:
    """Reward videos with a run's learned reward: one number each, and every step's in a CSV file.

    Args:
        run: Directory that `bootifol train` wrote.
        videos: Video files (mp4, webm, gif …), folders of frames, .npy files, or demo sets.
        out: CSV file to write the reward of every step to: columns video, step, reward.
    """
    from bootifol.training.api import score_videos, write_scores

    rewards = score_videos(run, videos)
    table = Table("video", "steps", "mean reward a step", "sum")
    for name, of_video in rewards.items():
        table.add_row(name, str(len(of_video)), f"{of_video.mean():.4f}", f"{of_video.sum():.2f}")
    Console().print(table)
    if out is not None:
        write_scores(out, rewards)
        Console().print(f"every step's reward: {out}")
    return 0
