"""The command's own help: what it says, and what it must not wait for."""

from __future__ import annotations

import inspect
import subprocess
import sys
from importlib import import_module, metadata

import pytest

from bootifol.cli.main import COMMANDS, main


@pytest.mark.parametrize("name", [name for name, (module, _) in COMMANDS.items() if module])
def test_the_help_says_of_each_command_what_its_docstring_begins_with(name: str) -> None:
    module, summary = COMMANDS[name]

    docstring = inspect.getdoc(getattr(import_module(module), name)) or ""

    assert docstring.splitlines()[0] == summary


@pytest.mark.parametrize("words", [["--help"], []])
def test_help_imports_neither_torch_nor_a_simulator(words: list[str]) -> None:
    code = (
        "import sys\n"
        "from bootifol.cli.main import main\n"
        f"try: main({words!r})\n"
        "except SystemExit: pass\n"
        "print([name for name in ('torch', 'numpy', 'mujoco', 'matplotlib') if name in sys.modules])"
    )

    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout

    assert all(name in printed for name in COMMANDS)
    assert printed.splitlines()[-1] == "[]"


def test_version_is_the_packages(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0

    assert capsys.readouterr().out == f"bootifol {metadata.version('bootifol')}\n"
