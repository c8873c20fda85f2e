"""The command that measures policies as ONNX files."""

from __future__ import annotations

import pytest
from benchmarks.onnx_policies import main

pytest.importorskip("onnxscript")
pytest.importorskip("onnxruntime")


def test_a_line_a_preset(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--presets", "drawn", "--actions", "3"]) == 0

    header, _, line = capsys.readouterr().out.splitlines()
    assert header.startswith("| Preset | Sees | MB |")
    assert line.startswith("| `drawn` | 2 × 32×32, states | ")


def test_a_preset_that_does_not_exist_is_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--presets", "drown"]) == 2
    assert capsys.readouterr().err.startswith("error: ")
