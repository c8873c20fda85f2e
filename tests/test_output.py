"""A terminal, a pipe or a disk that goes away takes nothing with it but words."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from filelock import FileLock

from bootifol.errors import BootifolError
from bootifol.locks import one_writer

SPEAKS = """
import sys
from rich.console import Console
from bootifol.output import output_may_fail
from bootifol.progress import progress
with output_may_fail():
    with progress("working", 2) as advance:
        print("x" * 100_000)
        Console().print("x" * 99)
        Console(stderr=True).print("x" * 99)
        advance(2)
raise SystemExit(130)
"""


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("goes_to", ["closed pipe", "full disk", "closed"])
def test_the_exit_code_is_the_commands_own(goes_to: str, unbuffered: str) -> None:
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    if goes_to == "closed pipe":
        reader, out = os.pipe()
        os.close(reader)
    elif not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    else:
        out = os.open("/dev/full", os.O_WRONLY)
    closing = "import os; os.close(1); os.close(2)\n" if goes_to == "closed" else ""
    done = subprocess.run(
        [sys.executable, "-c", closing + SPEAKS], env=environment, stdout=out, stderr=out, timeout=60
    )
    os.close(out)
    assert done.returncode == 130


def test_one_process_at_a_time_writes_to_a_directory(tmp_path: Path) -> None:
    directory = tmp_path / "made" / "run"
    with one_writer(directory):
        said = f"another process is writing to {directory}"
        with pytest.raises(BootifolError, match=said), one_writer(directory):
            raise AssertionError
        (directory / "kept").touch()
    assert [path.name for path in directory.iterdir()] == ["kept"]
    with one_writer(tmp_path / "empty"):
        pass
    assert not (tmp_path / "empty").exists()


def test_a_lock_of_a_process_that_is_gone_holds_nobody_up(tmp_path: Path) -> None:
    (tmp_path / ".lock").write_text("4711")
    with one_writer(tmp_path):
        pass
    held = FileLock(tmp_path / ".lock")
    with held, pytest.raises(BootifolError, match="another process"), one_writer(tmp_path):
        pass
