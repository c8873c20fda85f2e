"""Keeps results: adds runs to a collection, the few files that tables and figures read like the runs themselves.

    python -m benchmarks.collect runs/reacher/reacher_hard --out results/suites/reacher_hard --ranking
    bootifol table results/suites/reacher_hard/virl

A run is named by its path below the directory that was given, or as its own directory; it replaces the run of that
name. Configuration, versions, command and evaluations are kept in any case, rankings of held-out videos with
`--ranking`, and of what it logged what `--metrics` names.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.command import command
from bootifol.errors import BootifolError
from bootifol.reports.collection import add_to_collection
from bootifol.reports.run_files import find_runs


def named(paths: Sequence[Path]) -> dict[str, Path]:
    """The run directories at the paths and below, by the names that they get.

    Raises:
        BootifolError: a path leads to no run, or two runs would have one name.
    """
    runs: dict[str, Path] = {}
    for path in paths:
        for run_dir in find_runs([path]):
            below = run_dir.relative_to(path).as_posix()
            name = run_dir.resolve().name if below == "." else below
            if name in runs:
                raise BootifolError(
                    f"{run_dir} and {runs[name]} would both be {name}: give the directory that holds both"
                )
            runs[name] = run_dir
    return runs


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", type=Path, nargs="+", help="run directories, or directories that hold some")
    parser.add_argument("--out", type=Path, required=True, help="directory of the collection")
    parser.add_argument("--metrics", nargs="+", default=[], help="what to keep, as metrics.jsonl names it")
    parser.add_argument("--ranking", action="store_true", help="keep the rankings of held-out videos")
    options = parser.parse_args(arguments)
    runs = named(options.runs)
    add_to_collection(options.out, runs, options.metrics, options.ranking)
    print(f"{options.out}: {len(runs)} run{'s' if len(runs) > 1 else ''} added")


if __name__ == "__main__":
    raise SystemExit(main())
