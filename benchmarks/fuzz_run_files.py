"""Configurations, manifests, metrics, collections and checkpoints as nobody writes them, against all that reads them.

    python -m benchmarks.fuzz_run_files --minutes 10

Whole files of a small run are changed by hypothesis: values replaced by others of any kind, nested deeply, long as
books, not finite; texts cut, repeated, filled with signs. Whatever opens a run or a demo set must read them or refuse
them with a sentence (`BootifolError`). Exit code 1 on any other exception, with the file that raised it.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis
from hypothesis import strategies as st
from tests.training.tiny_runs import ENDS_SOON, new_run, record_demos

from benchmarks.command import command
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.manifest import find_demo_sets
from bootifol.errors import BootifolError
from bootifol.evaluation.tables import EvaluationRow, append_evaluations
from bootifol.reports.collection import add_to_collection, read_runs
from bootifol.reports.comparison import compare
from bootifol.reports.findings import findings
from bootifol.reports.run_files import flattened, read_run
from bootifol.training.checkpoint import load_checkpoint, newest_checkpoint
from bootifol.training.provenance import videos_in
from bootifol.training.run_config import RunConfig
from bootifol.training.run_directory import require_same_videos

NUMBERS = st.one_of(
    st.integers(-3, 3),
    st.integers(),
    st.sampled_from([10**9, 10**12, 2**63, 10**40, -(10**30), 10**400, 10**4000]),
    st.floats(allow_nan=True, allow_infinity=True),
)
TEXTS = st.one_of(
    st.text(max_size=20),
    st.sampled_from(
        ["[/x]", "²", "../../etc", "os:abort", "\x1b[2J", "\0", "a" * 5000, "NaN", "gymnasium:a:B"]
    ),
)
LEAVES = st.one_of(st.none(), st.booleans(), NUMBERS, TEXTS)
VALUES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4)
)


@st.composite
def changed(draw: st.DrawFn, value: Any) -> Any:
    """The value with something in it replaced, taken out, or put in."""
    if isinstance(value, dict) and value and draw(st.integers(0, 9)):
        key = draw(st.sampled_from(sorted(value)))
        rest = {name: inner for name, inner in value.items() if name != key}
        return rest if not draw(st.integers(0, 9)) else {**rest, key: draw(changed(value[key]))}
    if isinstance(value, list) and value and draw(st.integers(0, 9)):
        place = draw(st.integers(0, len(value) - 1))
        return [*value[:place], draw(changed(value[place])), *value[place + 1 :]]
    return draw(VALUES)


@st.composite
def wild_text(draw: st.DrawFn, text: str) -> str:
    """JSON that was changed, or a text that is none any more."""
    try:
        value = json.loads(text)
    except ValueError:  # lines of it
        lines = text.splitlines()
        place = draw(st.integers(0, len(lines) - 1))
        return "\n".join([*lines[:place], draw(wild_text(lines[place])), *lines[place + 1 :]]) + "\n"
    if isinstance(value, dict):
        value.pop("checksum", None)  # a stranger would make one that fits
    how = draw(st.integers(0, 9))
    if how < 7:
        return json.dumps(draw(changed(value)), ensure_ascii=draw(st.booleans()))
    whole = json.dumps(value)
    first, last = sorted((draw(st.integers(0, len(whole))), draw(st.integers(0, len(whole)))))
    put_in = draw(
        st.sampled_from(["", "[" * 99_999, '{"a":' * 2000, "9" * 5000, "\0", "�", "\n"]) | st.text()
    )
    return whole[:first] + put_in + whole[last:]


def opened(run: Path, demos: Path) -> dict[str, Callable[[], object]]:
    """Everything that reads one of the files, by what it reads."""

    whole = read_run(run)

    def configuration() -> object:
        config = RunConfig.read(run)
        require_same_videos(run, config)
        return config.resolved_task()

    def report() -> object:
        files = read_run(run)
        compare([files, whole], unfinished=True)
        return findings(files), list(flattened(files.config)), files.agent_steps

    def collection() -> object:
        runs = read_runs([run.parent / "kept"])
        compare([*runs, whole], unfinished=True)
        return [(findings(files), list(flattened(files.config)), files.agent_steps) for files in runs]

    def index() -> object:
        newest = newest_checkpoint(run / "checkpoints")
        return None if newest is None else load_checkpoint(newest, {})

    def manifest() -> object:
        return [DemoSet.open(path) for path in find_demo_sets(demos).values()], videos_in(demos)

    return {
        "config.json": configuration,
        "report": report,
        "collection": collection,
        "checkpoint.json": index,
        "manifest.json": manifest,
    }


def small_run(directory: Path) -> tuple[Path, Path]:
    """A run of seconds and its videos; beside the run a collection, `kept`, that holds it."""
    demos = record_demos(directory / "demos")
    new_run(directory / "run", demos, config=ENDS_SOON).learn()
    append_evaluations(
        directory / "run" / "evaluations.csv", [EvaluationRow(1, 1.0, 60, 0, 7, 0.5, None, None)]
    )
    add_to_collection(
        directory / "kept", {"run": directory / "run"}, ["episode/learned_reward"], ranking=True
    )
    return directory / "run", demos


def files_of(run: Path, demos: Path) -> dict[str, Path]:
    """The files that are changed, by name."""
    newest = newest_checkpoint(run / "checkpoints")
    assert newest is not None
    return {
        "config.json": run / "config.json",
        "metrics.jsonl": run / "metrics.jsonl",
        "checkpoint.json": newest / "checkpoint.json",
        "manifest.json": demos / "expert" / "manifest.json",
        "runs.json": run.parent / "kept" / "runs.json",
    }


def attack(path: Path, text: str, readers: dict[str, Callable[[], object]]) -> str:
    """What came of a file with another text in it: read, or refused; anything else is raised.

    Afterwards the file is as before.
    """
    whole = path.read_bytes()
    path.write_bytes(text.encode(errors="surrogatepass"))
    outcome = "read"
    try:
        for read in readers.values():
            try:
                with contextlib.redirect_stderr(io.StringIO()):
                    read()
            except BootifolError:
                outcome = "refused"
    finally:
        path.write_bytes(whole)
    return outcome


def fuzz(path: Path, readers: dict[str, Callable[[], object]], examples: int, seed: int) -> Counter[str]:
    """How many changed files were read and refused; any other exception is raised, with the text that did it."""
    whole, outcomes = path.read_text(), Counter[str]()

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=examples,
        deadline=None,
        database=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    @hypothesis.given(wild_text(whole))
    def run(text: str) -> None:
        outcomes[attack(path, text, readers)] += 1

    run()
    return outcomes


@command()
def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=10.0)
    arguments = parser.parse_args()
    directory = Path(tempfile.mkdtemp())
    try:
        run, demos = small_run(directory)
        readers, files = opened(run, demos), files_of(run, demos)
        end, seed = time.monotonic() + 60 * arguments.minutes, 0
        outcomes: dict[str, Counter[str]] = {name: Counter() for name in files}
        while time.monotonic() < end:
            for name, path in files.items():
                outcomes[name] += fuzz(path, readers, 200, seed)
            seed += 1
    finally:
        shutil.rmtree(directory)
    for name, counted in outcomes.items():
        print(f"{name}: {counted.total():,} texts, {counted['read']:,} read, {counted['refused']:,} refused")
    print(f"no other exception in {arguments.minutes:g} minutes")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
