"""The directory of a run: nothing in it is taken over from another, wiped, or led out of it by a link."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bootifol.errors import BootifolError
from bootifol.files import remove_leftovers
from bootifol.locks import one_writer
from bootifol.training.checkpoint import newest_checkpoint
from bootifol.training.provenance import videos_in
from bootifol.training.run_config import RunConfig

MEASURED = ("metrics.jsonl", "evaluations.csv", "ranking.csv", "policy.safetensors", "showcase.safetensors")
"""What stands in a run's directory once something was learned."""

WRITTEN = ("config.json", *MEASURED, "checkpoints", "videos", "tensorboard", "wandb", "report.html")
"""All that a run writes."""


@contextmanager
def writing_run(directory: Path) -> Iterator[None]:
    """Nobody else writes to a run while this is entered; what processes that were killed left there is removed.

    Raises:
        BootifolError: another process writes there, this one may not, or a link leads out of the run.
    """
    with one_writer(directory):
        for name in WRITTEN:
            _require_inside(directory, directory / name)
        remove_leftovers(directory)
        yield


def require_unused(directory: Path) -> None:
    """Refuses to begin a run where another one is, or was.

    Raises:
        BootifolError: see there.
    """
    if (directory / "config.json").exists():
        raise BootifolError(
            f"{directory} holds a run already: go on with `bootifol train --resume {directory}`, or choose "
            "another --out"
        )
    found = [name for name in WRITTEN if (directory / name).exists()]
    if found:
        raise BootifolError(
            f"{directory} holds {', '.join(found)} of a run whose config.json is missing: choose another --out, or "
            "move them away"
        )


def require_resumable(directory: Path) -> None:
    """Refuses to go on with a run that would begin anew and lose what it measured, such as a copy without checkpoints.

    Raises:
        BootifolError: see there.
    """
    found = [name for name in MEASURED if (directory / name).exists() and (directory / name).stat().st_size]
    if found and newest_checkpoint(directory / "checkpoints") is None:
        raise BootifolError(
            f"{directory} has no checkpoint to go on from, and to begin anew would lose its {', '.join(found)}: copy "
            "its checkpoints/ there, or begin a new run with another --out"
        )


def require_same_videos(directory: Path, run: RunConfig) -> None:
    """Refuses to go on with other videos than a run began with.

    Raises:
        BootifolError: their number or their pixels are not those that `config.json` has written down.
    """
    began = RunConfig.videos_of(directory)
    for behavior, now in videos_in(Path(run.demos)).items():
        before = began.get(behavior)
        if before is not None and before != now:
            raise BootifolError(
                f"the {behavior} videos in {run.demos} are not the ones that {directory} learned from (now "
                f"{now['count']} with the digest {now['digest']}, then {before['count']} with {before['digest']}): put "
                "those back, or begin a new run"
            )


def _require_inside(directory: Path, path: Path) -> None:
    if path.is_symlink():
        try:
            inside = path.resolve(strict=True).is_relative_to(directory.resolve())
        except (OSError, RuntimeError):
            inside = False
        if not inside:
            raise BootifolError(
                f"{path} is a link that leaves the run, which would be written through it: put there what it leads to"
            )
