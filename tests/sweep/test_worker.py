"""What is done on the machine of a run, without Ray."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from tiny_sweeps import RUN, write_config, write_end

from bootifol.sweep import worker
from bootifol.sweep.beside import Place, error_file, log_file, place_file
from bootifol.sweep.run_state import run_state
from bootifol.sweep.worker import Ending, Killed, Surroundings, what_went_wrong


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The directory that a sweep was begun in."""
    monkeypatch.chdir(tmp_path)
    yield tmp_path


def plays(monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    """Puts a program in place of `bootifol`; its words are in `sys.argv[1:]`."""
    monkeypatch.setattr(worker, "PROGRAM", (sys.executable, "-c", f"import json, os, sys, time\n{code}"))


def surroundings(cpus: int = 1, gpus: float = 0.0) -> Surroundings:
    return Surroundings(str(Path.cwd()), "mine", cpus, gpus)


def work_on(directory: Path, recording: str = "", where: Surroundings | None = None) -> Ending:
    words = RUN.words(directory), RUN.words_to_resume(directory)
    return worker.work_on(directory, *words, recording, where or surroundings())


def test_a_run_has_its_threads_its_modules_and_no_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    plays(monkeypatch, "json.dump([sys.argv[1:], dict(os.environ)], open('called', 'w'))")
    directory = Path("out/drawn_home/bootifol/seed1")
    assert work_on(directory, where=surroundings(cpus=3)) == Ending(done=True)
    words, environment = json.loads(Path("called").read_text())
    assert words[0] == "train" and "--resume" not in words
    assert environment["OMP_NUM_THREADS"] == environment["NUMBA_NUM_THREADS"] == "3"
    assert (environment["PYTHONPATH"], environment["CUDA_VISIBLE_DEVICES"]) == ("mine", "")
    assert not place_file(directory).exists()


def test_a_run_with_a_gpu_has_the_one_that_ray_gave_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "5")
    plays(monkeypatch, "open('called', 'w').write(os.environ['CUDA_VISIBLE_DEVICES'])")
    work_on(Path("out/seed1"), where=surroundings(gpus=1.0))
    assert Path("called").read_text() == "5"


def test_a_run_that_was_begun_is_resumed_and_its_place_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    directory = Path("out/seed1")
    write_config(directory)
    code = "while not os.path.exists('out/seed1.running'): time.sleep(0.01)\n"
    plays(monkeypatch, code + "os.rename('out/seed1.running', 'seen.running')\nprint(sys.argv)")
    work_on(directory)
    place = Place.of(Path("seen"))
    assert place is not None and (place.host, place.resumed) == (socket.gethostname(), True)
    assert "'train', '--resume', 'out/seed1'" in log_file(directory).read_text()


def test_a_failure_keeps_its_sentence_until_it_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    directory = Path("out/seed1")
    write_config(directory)
    plays(monkeypatch, "sys.exit('a line before\\nerror: the loss is nan')")
    assert work_on(directory) == Ending(error="the loss is nan")
    assert (run_state(directory).state, run_state(directory).error) == ("failed", "the loss is nan")
    write_end(directory, 12.0)
    plays(monkeypatch, "assert not os.path.exists('out/seed1.failed')")
    assert work_on(directory).done and run_state(directory).state == "done"
    assert not error_file(directory).exists()


@pytest.mark.parametrize(
    ("code", "sentence"),
    [
        ("os.kill(os.getpid(), 9)", "killed by SIGKILL"),
        ("sys.exit(130)", "asked to stop from outside of the sweep"),
    ],
)
def test_a_run_that_is_killed_did_not_fail(monkeypatch: pytest.MonkeyPatch, code: str, sentence: str) -> None:
    directory = Path("out/seed1")
    write_config(directory)
    plays(monkeypatch, code)
    with pytest.raises(Killed, match=sentence):
        work_on(directory)
    assert run_state(directory).state == "begun"
    assert not place_file(directory).exists()


def test_videos_that_could_not_be_recorded_fail_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    plays(monkeypatch, "sys.exit('error: no expert is bundled for hopper_stand')")
    recording = worker.record(["demos", "record"], Path("demos/hopper_stand.log"), surroundings())
    assert recording == "no expert is bundled for hopper_stand"
    assert work_on(Path("out/seed1"), recording).error == f"its videos could not be recorded: {recording}"


def test_a_run_that_is_asked_to_stop_writes_its_checkpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    directory = Path("out/seed1")
    write_config(directory)
    plays(monkeypatch, "open('begun', 'w')\nos.read(0, 1)\nopen('checkpoint', 'w')\nsys.exit(1)")

    def ask() -> None:
        while not Path("begun").exists():
            threading.Event().wait(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=ask).start()
    assert work_on(directory) == Ending(), "it did not fail"
    assert Path("checkpoint").exists() and run_state(directory).state == "begun"


def test_a_run_that_is_asked_to_stop_twice_is_still_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    code = "open('begun', 'w')\nos.read(0, 1)\nopen('asked', 'w')\nwhile not os.path.exists('twice'): pass\n"
    plays(monkeypatch, f"{code}time.sleep(0.5)\nopen('checkpoint', 'w')")

    def ask_as(file: str) -> None:
        while not Path(file).exists():
            threading.Event().wait(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    def ask_twice() -> None:
        ask_as("begun")
        ask_as("asked")
        Path("twice").touch()

    threading.Thread(target=ask_twice).start()
    assert work_on(Path("out/seed1")) == Ending()
    assert Path("checkpoint").exists()


def test_a_machine_without_the_files_gets_a_sentence() -> None:
    error = work_on(Path("out/seed1"), where=Surroundings("/no/such/directory", "", 1, 0.0)).error
    assert "does not have the files of the sweep at /no/such/directory" in error
    assert "all machines must share a file system" in error


@pytest.mark.parametrize(
    ("exit_code", "printed", "sentence"),
    [
        (2, "error: first\nerror: no such task\nstopped\n\n", "no such task"),
        (1, "Traceback\n  File x\nValueError: wrong\n", "ValueError: wrong"),
        (3, "", "exit code 3"),
        (-9, "", "killed by SIGKILL (is there enough memory?)"),
    ],
)
def test_what_went_wrong_is_one_line(tmp_path: Path, exit_code: int, printed: str, sentence: str) -> None:
    before = "error: of an earlier attempt\n"
    (tmp_path / "log").write_text(before + printed)
    assert what_went_wrong(exit_code, tmp_path / "log", len(before)) == sentence


def test_who_waits_for_a_run_imports_next_to_nothing() -> None:
    code = "import sys, bootifol.sweep.worker\nprint('torch' in sys.modules or 'scipy' in sys.modules)"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed == "False\n"
