"""`bootifol sweep`: many runs, on one machine or on a cluster."""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from bootifol.cli.arguments import Trust
from bootifol.errors import STOPPED, BootifolError, require_at_least

if TYPE_CHECKING:
    from bootifol.sweep.planned import PlannedRun

File = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.yaml")]
ListOnly = Annotated[
    tyro.conf.UseCounterAction[int],
    tyro.conf.arg(name="list", metavar="", help_behavior_hint="(default: no)"),
]
Patterns = Annotated[
    tuple[str, ...], tyro.conf.arg(metavar="PATTERN [PATTERN ...]", help_behavior_hint="(default: all)")
]


def sweep(
    file: File,
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="PATH", help_behavior_hint="(default: runs/FILE)")
    ] = None,
    address: Annotated[
        str | None, tyro.conf.arg(metavar="ADDRESS", help_behavior_hint="(default: this machine alone)")
    ] = None,
    cpus: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: all)")] = None,
    only: Patterns = (),
    list_only: ListOnly = 0,
    trust: Trust = 0,
) -> int:
    """Train tasks, methods, variants and seeds that a file names, on this machine's cores or on a Ray cluster.

    Each run is a `bootifol train` in OUT/TASK/METHOD[-VARIANT]/seedN. The same command goes on where it stopped: what
    is done is skipped, what was interrupted is resumed, what failed is tried again. Ctrl-C lets the runs write
    checkpoints and exits with 130. docs/suites.md says what the file holds.

    Exits with 0 when every run is done, and with 1 when some are not.

    Args:
        file: Which runs there are, in YAML.
        out: Directory of the runs.
        address: Of a Ray cluster whose machines share the file system, such as auto on one of them.
        cpus: Cores of this machine to use, without --address.
        only: Runs by name, such as '*/virl/*'.
        list_only: Print the runs and how far each is, and run nothing.
        trust: Import the code that FILE names (MODULE:NAME).
    """
    from bootifol.sweep.run_state import run_state
    from bootifol.sweep.sweep import sweep as run_sweep
    from bootifol.sweep.sweep_file import read_sweep

    runs = _chosen(read_sweep(file, bool(trust)), only)
    directory = out or Path("runs") / file.stem
    if list_only:
        width = max(len(run.name) for run in runs)
        for run in runs:
            print(f"{run.name:{width}}  {run_state(directory / run.name)}")
        return 0
    if cpus is not None:
        require_at_least(1, **{"--cpus": cpus})
        if address is not None:
            raise BootifolError(
                "--cpus is of this machine, and --address of another cluster: leave one of them out"
            )
    outcome = run_sweep(runs, directory, address, cpus)
    print(f"{outcome} of {len(runs)} runs in {directory}")
    if outcome.stopped:
        return STOPPED
    return 0 if outcome.done == len(runs) else 1


def _chosen(runs: Sequence[PlannedRun], patterns: Sequence[str]) -> list[PlannedRun]:
    """The runs whose names match a pattern; all without one.

    Raises:
        BootifolError: none does.
    """
    found = [run for run in runs if not patterns or any(fnmatch.fnmatch(run.name, p) for p in patterns)]
    if not found:
        raise BootifolError(
            f"no run of the sweep matches {' or '.join(patterns)}; names are like {runs[0].name}"
        )
    return found
