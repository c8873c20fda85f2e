"""What a stranger's files name as code is not imported unless a person says so."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import bootifol
from bootifol import plugins
from bootifol.cli.main import main
from bootifol.errors import BootifolError

NAMES = ["evil:make", "gymnasium:evil:Foo-v0", "os:abort", "sys:exit", "builtins:breakpoint", "evil:make:"]


@pytest.fixture
def evil(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A module in the current directory, and the file that it writes when it is imported."""
    here, mark = tmp_path / "here", tmp_path / "it_ran"
    here.mkdir()
    (here / "evil.py").write_text(
        f"open({str(mark)!r}, 'w').close()\ndef make(*_):\n    raise SystemExit(0)\n"
    )
    monkeypatch.chdir(here)
    monkeypatch.setattr(plugins, "_allowed", set())
    yield mark
    sys.modules.pop("evil", None)
    if str(here) in sys.path:
        sys.path.remove(str(here))


@pytest.fixture
def gift(finished: Path, tmp_path: Path) -> Path:
    """A run as a stranger might send it."""
    run = tmp_path / "gift"
    shutil.copytree(finished, run)
    (run / "policy.safetensors").unlink()
    return run


def name_in(run: Path, field: str, name: str) -> None:
    path = run / "config.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {field: name}))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("field", ["task", "method"])
def test_a_run_that_names_code_is_refused_with_the_name_and_the_file(
    gift: Path, evil: Path, capsys: pytest.CaptureFixture[str], field: str, name: str
) -> None:
    name_in(gift, field, name)
    commands = [["score", str(gift), "video.mp4"], ["train", "--resume", str(gift)]]
    if field == "task":
        commands.append(["evaluate", str(gift), "--episodes", "1"])
    for words in commands:
        assert main(words) == 2
        said = capsys.readouterr().err
        assert f"{gift / 'config.json'} names the {field} '{name}'" in said and "--trust" in said
    if field == "task":
        with pytest.raises(BootifolError, match="none of it was run"):
            bootifol.load_policy(gift)
    else:
        assert main(["evaluate", str(gift), "--episodes", "1"]) == 0, "a policy acts without its reward"
    assert not evil.exists() and "evil" not in sys.modules


def test_a_report_of_such_a_run_imports_nothing(gift: Path, evil: Path, tmp_path: Path) -> None:
    name_in(gift, "task", "evil:make")
    bootifol.report([gift], tmp_path / "report.html")
    assert not evil.exists()


def test_who_trusts_the_code_may_run_it(gift: Path, evil: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name_in(gift, "task", "evil:make")
    assert main(["evaluate", "--trust", str(gift)]) == 2
    assert "evil:make failed" in capsys.readouterr().err
    assert evil.exists()


def test_a_name_typed_in_this_process_needs_no_other_word(
    gift: Path, evil: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name_in(gift, "task", "evil:make")
    assert main(["tasks", "evil:make"]) == 2
    assert main(["evaluate", str(gift)]) == 2
    assert "evil:make failed" in capsys.readouterr().err


def test_a_part_of_python_is_never_called_even_when_trusted(
    gift: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name_in(gift, "task", "os:abort")
    assert main(["evaluate", str(gift), "--trust"]) == 2
    assert "os is a part of Python itself" in capsys.readouterr().err


def test_videos_that_name_code_are_refused_unless_the_task_is_typed(
    demos: Path, evil: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(demos, tmp_path / "gift")
    for path in (tmp_path / "gift").glob("*/manifest.json"):
        manifest = json.loads(path.read_text())
        manifest.pop("checksum", None)
        path.write_text(json.dumps(manifest | {"task": "evil:make"}))
    words = ["train", "--demos", str(tmp_path / "gift"), "--out", str(tmp_path / "run")]
    assert main(words) == 2
    assert "manifest.json names the task 'evil:make'" in capsys.readouterr().err
    assert not evil.exists()
    assert main([*words, "--task", "evil:make"]) == 2
    assert evil.exists(), "the person typed the name"
    assert not (tmp_path / "run").exists()
