"""Runs a suite of the paper's comparisons as a queue on one machine.

    python -m benchmarks.suite reacher --workers 2 --time-budget 60m     # every system on Reacher Hard, an hour a run
    python -m benchmarks.suite reacher --time-budget 60m --list          # what would run, and how far it is
    python -m benchmarks.suite alignment --preset drawn --tasks drawn_home

Each run is a `bootifol train` on a core of its own, in OUT/TASK/METHOD[-VARIANT]/seedN. The same command goes on where
it stopped: what is done is skipped, what was interrupted is resumed, what failed is tried again. Ctrl-C lets the runs
write checkpoints. `--keep DIR` copies the results of what is done, small enough for a repository; another machine
that has the copies goes on with the rest. docs/suites.md tells more.
"""

from __future__ import annotations

import argparse
import fnmatch
from collections.abc import Sequence
from pathlib import Path

from benchmarks.command import command
from benchmarks.run_queue import PROGRAM, RunQueue
from benchmarks.run_state import run_state
from benchmarks.suites import SUITES, PlannedRun, named
from bootifol.errors import BootifolError
from bootifol.presets import PRESETS


@command(resumes=True)
def main(words: Sequence[str] | None = None, program: Sequence[str] = PROGRAM) -> int:
    """The command.

    Args:
        words: of the command line.
        program: the command that `train` and `demos record` are words to.

    Returns:
        0 when every run is done, 1 when some are not, 2 after bad input, 130 after a second Ctrl-C.
    """
    arguments = parser().parse_args(words)
    return _work(arguments, program)


def parser() -> argparse.ArgumentParser:
    """Of the command line."""
    suites = "\n".join(f"  {name:18} {suite.description}" for name, suite in SUITES.items())
    made = argparse.ArgumentParser(
        description=f"{__doc__}\nsuites:\n{suites}", formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("name", metavar="NAME", help="of the suite")
    made.add_argument("--out", type=Path, help="directory of the runs (runs/NAME)")
    made.add_argument(
        "--demos", type=Path, default=Path("demos"), help="directory of the videos, one set a task (demos)"
    )
    made.add_argument(
        "--workers", type=int, default=1, help="runs side by side, each on a core of its own (1)"
    )
    made.add_argument("--time-budget", help="of each run, such as 60m; by default the preset's agent steps")
    made.add_argument("--videos", type=int, help="expert videos to record where there are none")
    made.add_argument("--preset", choices=list(PRESETS), help="instead of the suite's")
    made.add_argument("--tasks", nargs="+", help="instead of the suite's")
    made.add_argument("--seeds", type=int, nargs="+", help="instead of the suite's")
    made.add_argument("--own", nargs="+", default=[], metavar="MODULE:NAME", help="more methods to compare")
    made.add_argument("--only", nargs="+", metavar="PATTERN", help="runs by name, such as '*/virl/*'")
    made.add_argument(
        "--keep", type=Path, metavar="DIR", help="copies results of runs there; those that it has are done"
    )
    made.add_argument(
        "--list", action="store_true", help="print the runs and how far each is, and run nothing"
    )
    return made


def _work(arguments: argparse.Namespace, program: Sequence[str]) -> int:
    runs = named(arguments.name).runs(
        arguments.preset, arguments.tasks, arguments.seeds, arguments.time_budget is not None, arguments.own
    )
    runs = chosen(runs, arguments.only)
    out = arguments.out or Path("runs") / arguments.name
    if arguments.list:
        width = max(len(run.name) for run in runs)
        for run in runs:
            copy = arguments.keep and arguments.keep / run.name
            print(f"{run.name:{width}}  {run_state(out / run.name, copy)}")
        return 0
    queue = RunQueue(
        runs,
        out,
        arguments.demos,
        arguments.workers,
        arguments.time_budget,
        arguments.videos,
        program,
        say=lambda line: print(line, flush=True),
        kept=arguments.keep,
    )
    outcome = queue.work()
    print(f"{outcome} of {len(runs)} runs in {out}")
    return 0 if outcome.done == len(runs) else 1


def chosen(runs: Sequence[PlannedRun], patterns: Sequence[str] | None) -> list[PlannedRun]:
    """The runs whose names match a pattern; all without one.

    Raises:
        BootifolError: none does.
    """
    if patterns is None:
        return list(runs)
    found = [run for run in runs if any(fnmatch.fnmatch(run.name, pattern) for pattern in patterns)]
    if not found:
        raise BootifolError(
            f"no run of the suite matches {' or '.join(patterns)}; names are like {runs[0].name}"
        )
    return found


if __name__ == "__main__":
    raise SystemExit(main())
