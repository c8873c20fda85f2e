"""`bootifol score`: the learned reward along any video."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from bootifol.cli.arguments import RunPath, Trust, VideoPaths


def score(
    run: RunPath,
    videos: VideoPaths,
    out: Path | None = None,
    picture: Path | None = None,
    trust: Trust = 0,
) -> int:
    """Reward videos with a run's learned reward: one number each, every step's in a CSV file or above film strips.

    Args:
        run: Directory that `bootifol train` wrote.
        videos: Video files (mp4, webm, gif …), folders of frames, .npy files, LeRobot datasets, or demo sets.
        out: CSV file to write the reward of every step to: columns video, step, reward.
        picture: PNG file to draw the reward of every step to, above the film strips of the first six videos.
        trust: Import the code that the run names as its task or method (MODULE:NAME); other runs need none.
    """
    from bootifol import api
    from bootifol.reports.film_strip import rewards_above_film_strips
    from bootifol.reports.style import RUN_COLORS, require_png, save_png
    from bootifol.types import Rewards, Video

    if picture is not None:
        require_png(picture)
    rewards: dict[str, Rewards] = {}
    shown: list[tuple[Video, Rewards]] = []
    for video, of_video in api.scored_videos(run, videos, bool(trust)):
        rewards[video.name] = of_video
        if picture is not None and len(shown) < len(RUN_COLORS):
            shown.append((video, of_video))
    table = Table("video", "steps", "mean reward a step", "sum")
    for name, of_video in rewards.items():
        table.add_row(Text(name), str(len(of_video)), f"{of_video.mean():.4f}", f"{of_video.sum():.2f}")
    Console().print(table)
    if out is not None:
        api.write_scores(out, rewards)
        Console().print(f"every step's reward: {out}", markup=False)
    if picture is not None:
        save_png(rewards_above_film_strips(shown), picture)
        left_out = f" (of the first {len(shown)} videos)" if len(rewards) > len(shown) else ""
        Console().print(f"rewards above film strips: {picture}{left_out}", markup=False)
    return 0
