"""Damaged video files against the importer: it must read them or refuse them in a sentence, and never crash or hang.

    python -m benchmarks.fuzz_import --minutes 10

Whole files of the awkward corpus (`tests/video_files/awkward_files.py`) are damaged at random: bytes changed, a piece
cut off, taken out, repeated or copied in from another file. A worker process reads each and is watched from outside:
a crash takes its process along and a hang never returns. Exit code 1 on a crash, a hang, another exception than a
refusal, or a cut file read as if it were whole; the files that did it are kept in --keep. "Read otherwise": another
number of frames than before the damage, which may have changed what the file says of itself. "Told": the same, of a
file that does not say how long it is, with a warning that its end may be missing.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np
from tests.video_files.awkward_files import make_all

from benchmarks.command import command
from bootifol.reports.markdown import markdown_table

BAD = ("crash", "hang", "exception", "short read")

MEMORY_BYTES = 6 * 1024**3
"""Address space of a worker: a damaged header that asks for more must be refused, not served."""

Damage = Callable[[bytearray, np.random.Generator, bytes], bytearray]


def change_bytes(data: bytearray, rng: np.random.Generator, _: bytes) -> bytearray:
    for place in rng.integers(0, len(data), rng.integers(1, 20)):
        data[place] = rng.integers(256)
    return data


def flip_a_bit(data: bytearray, rng: np.random.Generator, _: bytes) -> bytearray:
    data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    return data


def truncate(data: bytearray, rng: np.random.Generator, _: bytes) -> bytearray:
    return data[: rng.integers(len(data))]


def take_out(data: bytearray, rng: np.random.Generator, _: bytes) -> bytearray:
    first, last = sorted(rng.integers(0, len(data), 2))
    return data[:first] + data[last:]


def repeat(data: bytearray, rng: np.random.Generator, _: bytes) -> bytearray:
    first, last = sorted(rng.integers(0, len(data), 2))
    return data[:last] + data[first:]


def splice(data: bytearray, rng: np.random.Generator, other: bytes) -> bytearray:
    """A piece of another file in place of as much of this one."""
    first, last = sorted(rng.integers(0, len(other), 2))
    place = int(rng.integers(len(data)))
    data[place : place + last - first] = other[first:last]
    return data


DAMAGES: tuple[Damage, ...] = (change_bytes, flip_a_bit, truncate, take_out, repeat, splice)


def read_files(orders: Connection) -> None:
    """The worker: reads one file after another and answers with what came of it and the number of frames."""
    import av

    from bootifol.errors import BootifolError, collected_warnings
    from bootifol.video_files.reading import stream_video

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this process
    av.logging.set_level(None)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    while True:
        path = orders.recv()
        count = 0
        try:
            with collected_warnings() as told:
                for _ in stream_video(path):
                    count += 1
            orders.send(("read", count, " ".join(note.what for note in told)))
        except BootifolError as error:
            named = path.name in str(error)
            orders.send(("refused" if named else "exception", count, str(error)))
        except Exception as error:  # whatever it is, it is what is looked for
            orders.send(("exception", count, f"{type(error).__name__}: {error}"))


class Reader:
    """A worker process that is replaced when it dies or hangs."""

    def __init__(self, timeout_seconds: float) -> None:
        self.timeout_seconds = timeout_seconds
        self._context = multiprocessing.get_context("spawn")
        self._process: BaseProcess | None = None
        self._orders: Any = None

    def read(self, path: Path) -> tuple[str, int, str]:
        """Outcome, frames read, and the sentence or exception."""
        if self._process is None:
            self._orders, theirs = self._context.Pipe()
            self._process = self._context.Process(target=read_files, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()
        try:
            self._orders.send(path)
            if self._orders.poll(self.timeout_seconds):
                answer: tuple[str, int, str] = self._orders.recv()
                return answer
            outcome = ("hang", 0, f"nothing after {self.timeout_seconds:g} s")
        except (EOFError, OSError):
            self._process.join()
            outcome = ("crash", 0, f"exit code {self._process.exitcode}")
        self.stop()
        return outcome

    def stop(self) -> None:
        """Ends the worker, if there is one."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None


@command()
def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0, help="the same seed damages in the same order")
    parser.add_argument("--timeout", type=float, default=20.0, help="seconds until a file counts as a hang")
    parser.add_argument("--keep", type=Path, default=Path("fuzz"), help="directory for files that fail")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    table: Counter[tuple[str, str]] = Counter()
    failures: list[str] = []
    reader = Reader(arguments.timeout)
    with tempfile.TemporaryDirectory() as directory:
        corpus = make_all(Path(directory) / "corpus")
        whole = [file for file in corpus if file.pictures is not None and file.path.is_file()]
        contents = {file.path: file.path.read_bytes() for file in whole}
        expected = {file.path: len(file.pictures) for file in whole if file.pictures is not None}
        for file in whole:
            outcome, count, said = reader.read(file.path)
            if outcome != "read" or count != expected[file.path]:
                failures.append(f"{file.path.name} undamaged: {outcome}, {count} frames {said}")
        end = time.monotonic() + 60 * arguments.minutes
        number = 0
        while time.monotonic() < end:
            file = whole[rng.integers(len(whole))]
            other = contents[whole[rng.integers(len(whole))].path]
            damage = DAMAGES[rng.integers(len(DAMAGES))]
            damaged = damage(bytearray(contents[file.path]), rng, other)
            path = Path(directory) / f"{number:06d}-{damage.__name__}-{file.path.name}"
            path.write_bytes(damaged)
            outcome, count, said = reader.read(path)
            if outcome == "read" and count != expected[file.path]:
                # A cut file misses frames for certain; any other damage may have changed what the file says of itself.
                if "whether its end is missing cannot be told" in said:
                    outcome = "told"
                else:
                    outcome = "short read" if damage is truncate else "read otherwise"
                said = f"{count} of {expected[file.path]} frames, no refusal"
            table[damage.__name__, outcome] += 1
            if outcome in BAD:
                arguments.keep.mkdir(parents=True, exist_ok=True)
                (arguments.keep / path.name).write_bytes(damaged)
                failures.append(f"{arguments.keep / path.name}: {outcome}: {said}")
            path.unlink()
            number += 1
        reader.stop()
    outcomes = ("read", "read otherwise", "told", "refused", *BAD)
    print(f"{number} damaged files in {arguments.minutes:g} minutes, seed {arguments.seed}\n")
    lines = [
        [damage.__name__, *(str(table[damage.__name__, outcome]) for outcome in outcomes)]
        for damage in DAMAGES
    ]
    print(markdown_table(["damage", *outcomes], lines))
    print("\n" + "\n".join(failures[:30]) if failures else "\nno crash, no hang, no short read")
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
