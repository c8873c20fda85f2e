"""Attacks what docs/safety.md promises, and counts how often it held.

    python -m benchmarks.attack --out results/attack.csv

Runs of a second or so are killed, stopped, starved of disk and output, written to by two, and handed files that were
changed; each is then resumed, and must end bit for bit as the run that nobody touched. Exit code 1 where a promise did
not hold once.
"""

from __future__ import annotations

import argparse
import errno
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from tests.training.tiny_runs import ENDS_SOON, new_run, record_demos, resumed
from torch.utils.tensorboard import SummaryWriter

from benchmarks.command import command
from benchmarks.fuzz_run_files import files_of, fuzz, opened
from benchmarks.rows import read_rows, write_rows
from bootifol import checksums, files, tracking
from bootifol.agents.policy import read_policy
from bootifol.cli.main import main as bootifol
from bootifol.demos.demo_set import DemoSet
from bootifol.errors import STOPPED, BootifolError
from bootifol.files import read_arrays, read_json
from bootifol.output import output_may_fail
from bootifol.reports.markdown import markdown_table
from bootifol.training.checkpoint import newest_checkpoint
from bootifol.training.interactive import InteractivePhase
from bootifol.training.run_directory import require_resumable, require_unused, writing_run
from bootifol.types import StepMetrics

CONFIG = replace(ENDS_SOON, tracker="tensorboard")
COLUMNS = ("promise", "tries", "held")
SENTENCE = 2
TRACEBACK = 1


@dataclass(frozen=True)
class Attack:
    """What the attacks share."""

    directory: Path
    demos: Path
    whole: Path
    """A run that nobody touched."""
    rng: np.random.Generator

    def new_place(self, name: str) -> Path:
        """A directory that is not there."""
        place = self.directory / name
        shutil.rmtree(place, ignore_errors=True)
        return place

    def is_as_whole(self, run: Path) -> bool:
        """Whether a run ended as the one that nobody touched, bit for bit but for times."""
        ours, theirs = newest_checkpoint(run / "checkpoints"), newest_checkpoint(self.whole / "checkpoints")
        if ours is None or theirs is None or ours.name != theirs.name:
            return False
        for file in sorted(theirs.glob("*.safetensors")):
            a, b = read_arrays(file, ""), read_arrays(ours / file.name, "")
            if a.keys() != b.keys() or not all(
                np.array_equal(a[name], b[name], equal_nan=True) for name in a
            ):
                return False
        return b"\0" not in (run / "metrics.jsonl").read_bytes()


def in_a_process(work: Callable[[], object], output: int | None = None) -> int:
    """Begins work in a copy of this process, which ends with a command's exit code; returns its number."""
    process = os.fork()
    if process:
        return process
    code, said = TRACEBACK, os.dup(2)
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY) if output is None else output
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        finished = work()
        code = finished if type(finished) is int else 0 if finished else STOPPED
    except BootifolError:
        code = SENTENCE
    except BaseException:
        os.write(said, traceback.format_exc().encode())
    finally:
        os._exit(code)


def ended(process: int) -> int:
    """The exit code of a process, minus its signal where one ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def train(attack: Attack, run: Path) -> bool:
    """Begins the run, or goes on with it, as `bootifol train` does, but without its last measurements and report."""
    with output_may_fail(), writing_run(run):
        if (run / "config.json").exists():
            require_resumable(run)
            return resumed(run).learn()
        require_unused(run)
        return new_run(run, attack.demos, config=CONFIG).learn()


@contextmanager
def at_call(number: int, act: Callable[[], None]) -> Iterator[list[str]]:
    """Calls `act` in place of the `number`th thing that is written, synced or renamed; yields the names of all."""
    calls: list[str] = []
    places: list[tuple[Any, str]] = [
        (Path, "replace"),
        (Path, "rename"),
        (Path, "mkdir"),
        (Path, "write_text"),
        (files, "save_file"),
        (files, "_sync"),
        (files, "seal"),
        (shutil, "rmtree"),
        (tracking.RunLog, "_append"),
        (os, "fsync"),
        (SummaryWriter, "add_scalar"),
    ]
    whole = [(owner, name, getattr(owner, name)) for owner, name in places]

    def watched(name: str, original: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            calls.append(name)
            if len(calls) == number:
                act()
            return original(*arguments, **named)

        return call

    for owner, name, original in whole:
        setattr(owner, name, watched(name, original))
    try:
        yield calls
    finally:
        for owner, name, original in whole:
            setattr(owner, name, original)


def kill_me() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def kills_at_writes(attack: Attack, tries: int) -> tuple[int, int]:
    """Killed at, and so between, renames, syncs and writes; resumed, and killed again further on."""
    held = done = round_number = 0
    while done < tries:
        run, number, before = attack.new_place("killed"), 1 + round_number, -1
        round_number += 1
        while done < tries:
            process = in_a_process(partial(_with_act, number, kill_me, partial(train, attack, run)))
            code = ended(process)
            if code == 0:
                break
            done += 1
            number += 7
            steps = _steps(run)
            held += code == -signal.SIGKILL and steps >= before
            before = max(before, steps)
        ended(in_a_process(partial(train, attack, run)))
        if not attack.is_as_whole(run):
            held = -tries
    return done, max(held, 0)


def kills_at_moments(attack: Attack, tries: int) -> tuple[int, int]:
    """Killed after random times."""
    held = done = 0
    while done < tries:
        run, before = attack.new_place("killed"), -1
        while done < tries:
            process = in_a_process(partial(train, attack, run))
            time.sleep(float(attack.rng.uniform(0.05, 1.5)))
            os.kill(process, signal.SIGKILL)
            if ended(process) == 0:
                break
            done += 1
            steps = _steps(run)
            held += steps >= before
            before = max(before, steps)
        ended(in_a_process(partial(train, attack, run)))
        if not attack.is_as_whole(run):
            held = -tries
    return done, max(held, 0)


def _steps(run: Path) -> int:
    """How far the newest checkpoint is, whose every byte is compared; -1 where there is none."""
    newest = newest_checkpoint(run / "checkpoints")
    if newest is None:
        return -1
    for file in newest.glob("*.safetensors"):
        read_arrays(file, "")
    counters = read_json(newest / "checkpoint.json", "")["counters"]
    return int(counters["agent_steps"]) + int(counters["alignment_steps"])


def _with_act(number: int, act: Callable[[], None], work: Callable[[], object]) -> object:
    with at_call(number, act):
        return work()


def full_disk(attack: Attack, tries: int) -> tuple[int, int]:
    """No space left at one write after another: a sentence, and the run goes on when there is space again."""
    counted = attack.new_place("counted")
    with at_call(0, lambda: None) as calls:
        train(attack, counted)
    writes = [
        number for number, name in enumerate(calls, start=1) if name != "rmtree"
    ]  # which needs no space
    places = [writes[index] for index in np.unique(np.linspace(0, len(writes) - 1, tries).astype(int))]

    def no_space() -> NoReturn:
        raise OSError(errno.ENOSPC, "No space left on device")

    held = 0
    for number in places:
        run = attack.new_place("full")
        work = partial(_with_act, number, no_space, partial(train, attack, run))
        code = ended(in_a_process(work))
        again = ended(in_a_process(partial(train, attack, run)))
        held += code == SENTENCE and again == 0 and attack.is_as_whole(run)
    return len(places), held


def pipes_that_close(attack: Attack, tries: int) -> tuple[int, int]:
    """The reader of the output goes away, and then a signal comes: exit code 130, a checkpoint, the same end."""
    held = 0
    for number in range(tries):
        run = attack.new_place("piped")
        new_run(run, attack.demos, config=CONFIG)
        reader, writer = os.pipe()
        sent = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[number % 3]
        episode = int(attack.rng.integers(0, 2))

        def stopped(
            run: Path = run, sent: signal.Signals = sent, episode: int = episode, reader: int = reader
        ) -> int:
            os.close(reader)
            play = InteractivePhase.play_episode

            def play_and_stop(self: InteractivePhase) -> list[StepMetrics]:
                if self.counters.episodes == episode:
                    os.kill(os.getpid(), sent)
                return play(self)

            InteractivePhase.play_episode = play_and_stop  # type: ignore[method-assign]
            return bootifol(["train", "--resume", str(run)])

        process = in_a_process(stopped, writer)
        os.close(writer)
        os.close(reader)
        stops = ended(process) == STOPPED and _steps(run) > 0
        held += stops and ended(in_a_process(partial(train, attack, run))) == 0 and attack.is_as_whole(run)
    return tries, held


def flips(attack: Attack, tries: int) -> tuple[int, int]:
    """One bit of one byte of any file that is loaded."""
    run, demos = attack.new_place("flipped"), attack.new_place("flipped_demos")
    shutil.copytree(attack.whole, run)
    shutil.copytree(attack.demos, demos)
    newest = newest_checkpoint(run / "checkpoints")
    assert newest is not None
    readers: dict[Path, Callable[[Path], object]] = {
        **{file: lambda path: read_arrays(path, "it") for file in sorted(newest.glob("*.safetensors"))},
        newest / "checkpoint.json": lambda path: read_json(path, "it"),
        run / "policy.safetensors": read_policy,
        **{
            file: lambda path: DemoSet.open(path.parent, verify=True)
            for behavior in ("expert", "random")
            for file in sorted((demos / behavior).glob("*"))
            if file.suffix in (".json", ".npy")
        },
    }
    held = 0
    for number in range(tries):
        path = list(readers)[number % len(readers)]
        whole = bytearray(path.read_bytes())
        # Half of them where files describe themselves, for that is where a reader could go wrong.
        place = int(attack.rng.integers(len(whole) if number % 2 else min(len(whole), 2000)))
        path.write_bytes(
            whole[:place] + bytes([whole[place] ^ (1 << int(attack.rng.integers(8)))]) + whole[place + 1 :]
        )
        try:
            readers[path](path)
        except BootifolError:
            held += 1
        path.write_bytes(whole)
    config = run / "config.json"
    assert checksums.is_as_written(config)
    return tries, held


def strangers_names(attack: Attack, tries: int) -> tuple[int, int]:
    """Runs and videos that name code, opened with every command in the directory where the code lies."""
    names = (
        "evil:make",
        "gymnasium:evil:Foo-v0",
        "os:abort",
        "sys:exit",
        "builtins:breakpoint",
        "posix:_exit",
    )
    place, gift, demos = (attack.new_place(name) for name in ("place", "gift", "gift_demos"))
    place.mkdir()
    mark = place / "it_ran"
    (place / "evil.py").write_text(f"open({str(mark)!r}, 'w').close()\n")
    shutil.copytree(attack.whole, gift)
    shutil.copytree(attack.demos, demos)
    (gift / "policy.safetensors").unlink()
    commands = [
        ["train", "--resume", str(gift)],
        ["score", str(gift), str(attack.demos / "expert")],
        ["evaluate", str(gift)],
        ["train", "--demos", str(demos), "--out", str(place / "run")],
    ]
    held = 0
    for number in range(tries):
        name, words = names[number % len(names)], commands[number // len(names) % len(commands)]
        field = "task" if number // (len(names) * len(commands)) % 2 == 0 or "evaluate" in words else "method"
        for path in [gift / "config.json", *demos.glob("*/manifest.json")]:
            value = read_json(path, "it", editable=True)
            files.write_json(
                path,
                value | {"task": "drawn_reach", "method": "bootifol"} | {field: name}
                if path.name == "config.json"
                else value | {"task": name},
            )

        def opens(words: list[str] = words) -> int:
            os.chdir(place)
            return bootifol(words)

        held += ended(in_a_process(opens)) == SENTENCE and not mark.exists()
    return tries, held


def two_writers(attack: Attack, tries: int) -> tuple[int, int]:
    """A second process writes to a run while the first one learns."""
    held = 0
    for number in range(tries):
        run = attack.new_place("shared")
        new_run(run, attack.demos, config=CONFIG)
        began, begins = os.pipe()

        def first(run: Path = run, begins: int = begins) -> bool:
            play = InteractivePhase.play_episode

            def play_and_tell(self: InteractivePhase) -> list[StepMetrics]:
                if not self.counters.episodes:
                    os.write(begins, b"1")
                    time.sleep(0.5)
                return play(self)

            InteractivePhase.play_episode = play_and_tell  # type: ignore[method-assign]
            return train(attack, run)

        process = in_a_process(first)
        os.read(began, 1)
        words = (
            ["--resume", str(run)]
            if number % 2
            else ["--task", "drawn_reach", "--demos", str(attack.demos), "--out", str(run)]
        )
        second = ended(in_a_process(partial(bootifol, ["train", *words])))
        held += second == SENTENCE and ended(process) == 0 and attack.is_as_whole(run)
        os.close(began)
        os.close(begins)
    return tries, held


def wild_files(attack: Attack, tries: int) -> tuple[int, int]:
    """Texts of hypothesis in place of configuration, metrics, checkpoint index and manifest."""
    run, demos = attack.new_place("wild"), attack.new_place("wild_demos")
    shutil.copytree(attack.whole, run)
    shutil.copytree(attack.demos, demos)
    readers, paths = opened(run, demos), files_of(run, demos)
    counted = sum(fuzz(path, readers, tries // len(paths), 0).total() for path in paths.values())
    return counted, counted  # any other exception than a refusal would have ended this


ATTACKS: dict[str, tuple[Callable[[Attack, int], tuple[int, int]], int]] = {
    "killed at a rename, a sync or a write": (kills_at_writes, 60),
    "killed at a random moment": (kills_at_moments, 40),
    "one bit of a loaded file changed": (flips, 300),
    "no space left at a write": (full_disk, 40),
    "stopped when nobody reads the output": (pipes_that_close, 12),
    "a stranger's file names code": (strangers_names, 48),
    "two writers to one run": (two_writers, 6),
    "wild texts in place of JSON": (wild_files, 800),
}
"""Attacks by what they are told as, and how often each is tried."""


@command()
def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("results/attack.csv"))
    parser.add_argument("--fraction", type=float, default=1.0, help="of the tries, for a quick look")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--only", nargs="+", default=[], help="words of the promises to try; the table's other rows stay"
    )
    arguments = parser.parse_args()
    directory = Path(tempfile.mkdtemp())
    rows = {row["promise"]: row for row in read_rows(arguments.out, COLUMNS)}
    try:
        demos, whole = record_demos(directory / "demos"), directory / "whole"
        attack = Attack(directory, demos, whole, np.random.default_rng(arguments.seed))
        train(attack, whole)
        for promise, (run, tries) in ATTACKS.items():
            if arguments.only and not any(word in promise for word in arguments.only):
                continue
            done, held = run(attack, max(1, round(arguments.fraction * tries)))
            rows[promise] = {"promise": promise, "tries": str(done), "held": str(held)}
            write_rows(arguments.out, COLUMNS, [rows[name] for name in ATTACKS if name in rows])
            print(f"{promise}: {held} of {done}", flush=True)
    finally:
        shutil.rmtree(directory)
    print(markdown_table(list(COLUMNS), [[row[column] for column in COLUMNS] for row in rows.values()]))
    return 0 if all(row["tries"] == row["held"] for row in rows.values()) else 1


if __name__ == "__main__":
    raise SystemExit(main())
