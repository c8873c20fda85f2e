"""`bootifol evaluate`: how good trained policies are."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from bootifol.cli.arguments import RunPaths, Trust
from bootifol.errors import BootifolError

if TYPE_CHECKING:
    from bootifol.api import RunEvaluation


def evaluate(
    runs: RunPaths,
    episodes: int = 10,
    seed: int = 1000,
    out: Path | None = None,
    videos: Path | None = None,
    trust: Trust = 0,
) -> int:
    """Play episodes with the newest policy of one run or several, without exploration, and print their returns.

    Args:
        runs: Directories that `bootifol train` wrote.
        episodes: How many of each run, each of the task's evaluation length.
        seed: Of the starts.
        out: CSV file to write a row for each episode to.
        videos: Directory to write each episode to, as an mp4; several runs get a directory each in it.
        trust: Import the code that the runs name as their task (MODULE:NAME); other runs need none.
    """
    # Imported here: help should not wait for PyTorch.
    from bootifol import api
    from bootifol.evaluation.tables import PlayedRow, write_played
    from bootifol.training.run_config import RunConfig
    from bootifol.training.saved_policy import require_checkpoint

    folders = _checked(runs, out, videos)
    for run in runs:
        # What cannot be played is heard of before another is.
        RunConfig.read(run, bool(trust), needs_method=False)
        require_checkpoint(run)
    console = Console(emoji=False)
    rows: list[PlayedRow] = []
    lines: list[str] = []
    for run, folder in zip(runs, folders, strict=True):
        if len(runs) > 1:
            console.print(str(run), markup=False, soft_wrap=True)
        result = api.evaluate(run, episodes, seed, folder, bool(trust))
        rows += [PlayedRow(**asdict(row), run=str(run)) for row in result.rows]
        lines.append(f"{run}: {_in_a_line(result)}")
        _print(result, console)
    if len(runs) > 1:
        for line in lines:
            console.print(line, markup=False, soft_wrap=True)
    if out is not None:
        write_played(out, rows)
        console.print(f"every episode: {out}", markup=False, soft_wrap=True)
    if videos is not None:
        console.print(f"videos: {videos}", markup=False, soft_wrap=True)
    return 0


def _checked(runs: list[Path], out: Path | None, videos: Path | None) -> list[Path | None]:
    """The directory of each run's videos, once nothing stands in the way of what shall be written.

    Raises:
        BootifolError: something does.
    """
    if not runs:
        raise BootifolError("there are no runs to evaluate: name directories that `bootifol train` wrote")
    if out is not None and out.is_dir():
        raise BootifolError(f"--out {out} is a directory: name a file, such as {out / 'episodes.csv'}")
    if videos is None:
        return [None] * len(runs)
    if videos.exists() and not videos.is_dir():
        raise BootifolError(f"--videos {videos} is a file: name a directory")
    if len(runs) == 1:
        return [videos]
    names = [run.resolve().name for run in runs]
    for name in names:
        if names.count(name) > 1:
            raise BootifolError(
                f"the videos of two runs named {name} would go to {videos / name}: evaluate them one by one, each with "
                "its own --videos"
            )
    return [videos / name for name in names]


def _print(result: RunEvaluation, console: Console) -> None:
    for number, episode in enumerate(result.episodes):
        solved = ", solved" if episode.success else ""
        console.print(f"episode {number}: return {episode.environment_return:.1f}{solved}")
    low, high = result.summary.interval or (result.summary.mean, result.summary.mean)
    console.print(
        f"mean return {result.summary.mean:.1f} (95 % interval {low:.1f} to {high:.1f}) over {len(result.episodes)} "
        f"episodes of {result.episode_steps} agent steps"
    )
    if result.scaled_return is not None:
        console.print(f"scaled return {result.scaled_return:.3f} (0: random actions, 1: the expert)")
    if result.solved is not None:
        console.print(f"solved {result.solved} of {len(result.episodes)}")


def _in_a_line(result: RunEvaluation) -> str:
    parts = [f"mean return {result.summary.mean:.1f}"]
    if result.scaled_return is not None:
        parts.append(f"scaled return {result.scaled_return:.3f}")
    if result.solved is not None:
        parts.append(f"solved {result.solved} of {len(result.episodes)}")
    return ", ".join(parts)
