"""Files are whole or absent, and what reads them believes nothing."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from bootifol.errors import BootifolError
from bootifol.files import (
    last_whole,
    parsed_json,
    read_arrays,
    read_json,
    read_texts,
    remove_leftovers,
    write_arrays,
    write_json,
    written_aside,
)

ARRAYS = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array(3, np.int64)}


def every_flip(path: Path, seed: int = 0) -> list[Path]:
    """Copies of a file, each with one bit of another byte changed."""
    whole, rng = path.read_bytes(), np.random.default_rng(seed)
    copies = []
    for place in range(len(whole)):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << int(rng.integers(8))
        copies.append(path.with_name(f"flip-{place}{path.suffix}"))
        copies[-1].write_bytes(flipped)
    return copies


def test_a_changed_bit_anywhere_in_arrays_is_found(tmp_path: Path) -> None:
    path = tmp_path / "arrays.safetensors"
    write_arrays(path, ARRAYS, {"bootifol": '{"format": 1}'})
    assert read_texts(path, "it") == {"bootifol": '{"format": 1}'}
    for flipped in every_flip(path):
        with pytest.raises(BootifolError, match="damaged"):
            read_arrays(flipped, "it")


def test_a_changed_bit_anywhere_in_sealed_json_is_found(tmp_path: Path) -> None:
    path = tmp_path / "value.json"
    write_json(path, {"format": 2, "counters": [1, 2.5, "x"]}, sealed=True)
    assert read_json(path, "it") == {"format": 2, "counters": [1, 2.5, "x"]}
    for flipped in every_flip(path):
        with pytest.raises(BootifolError, match=r"it cannot be read|is damaged"):
            read_json(flipped, "it")


def test_files_of_versions_without_checksums_are_read(tmp_path: Path) -> None:
    save_file(ARRAYS, tmp_path / "old.safetensors", {"bootifol": "{}"})
    read = read_arrays(tmp_path / "old.safetensors", "it")
    np.testing.assert_array_equal(read["a"], ARRAYS["a"])
    (tmp_path / "old.json").write_text('{"format": 2}')
    assert read_json(tmp_path / "old.json", "it") == {"format": 2}


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000 + "]" * 100_000,
        "[" * 60 + "]" * 60,
        '{"a": ' * 900 + "1" + "}" * 900,
        "1" * 5000,
        "1" * 60,
        "1e999",
        "NaN",
        '{"seed": -Infinity}',
        "{",
    ],
)
def test_json_that_nobody_means_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ValueError):
        parsed_json(text)
    (tmp_path / "value.json").write_text(text)
    with pytest.raises(BootifolError, match=r"the value cannot be read: .*value\.json"):
        read_json(tmp_path / "value.json", "the value")


def test_what_is_no_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "directory.json").mkdir()
    for name in ("pipe.json", "directory.json"):
        with pytest.raises(BootifolError, match="is no file"):
            read_json(tmp_path / name, "it")
        with pytest.raises(BootifolError, match="is no file"):
            read_arrays(tmp_path / name, "it")


@pytest.mark.parametrize("name", ["file/below/value.json", "x" * 300, "directory"])
def test_what_cannot_be_written_is_a_sentence_and_leaves_nothing(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("whole")
    (tmp_path / "directory").mkdir()
    with pytest.raises(BootifolError, match="cannot write"):
        write_json(tmp_path / name, {})
    assert {path.name for path in tmp_path.iterdir()} == {"file", "directory"}
    assert (tmp_path / "file").read_text() == "whole"


def test_a_directory_is_found_whatever_a_killed_process_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A directory that replaces another takes two renames, and a process may be killed in between."""
    target, replace = tmp_path / "set", Path.replace

    def write(text: str) -> None:
        with written_aside(target) as aside:
            aside.mkdir()
            (aside / "text").write_text(text)

    def killed(self: Path, other: Path) -> Path:
        if self.suffix == ".tmp":
            raise KeyboardInterrupt
        return replace(self, other)

    write("old")
    monkeypatch.setattr(Path, "replace", killed)
    monkeypatch.setattr("bootifol.files.shutil.rmtree", lambda *_, **__: None)  # it does not clean up either
    with pytest.raises(KeyboardInterrupt):
        write("new")
    monkeypatch.undo()
    assert not target.exists()
    assert (last_whole(target) / "text").read_text() == "old"
    remove_leftovers(tmp_path)
    assert [path.suffix for path in tmp_path.iterdir()] == [".old"], "the last whole one stays"
    assert (last_whole(target) / "text").read_text() == "old"


def test_a_value_with_a_checksum_stays_readable_json(tmp_path: Path) -> None:
    write_json(tmp_path / "value.json", {"a": 1}, sealed=True)
    assert json.loads((tmp_path / "value.json").read_text())["checksum"].startswith("xxh3-")
