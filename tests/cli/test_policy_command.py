"""`bootifol policy export` from the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.policy import PolicyConfig, write_policy
from bootifol.cli.main import main
from bootifol.envs.pictures import PictureConfig

pytest.importorskip("onnxscript")
pytest.importorskip("onnxruntime")


def test_a_policys_file_becomes_an_onnx_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    agent = DrQv2(DrQv2Config(encoder="strided", feature_dim=8, hidden_dim=16), 24, 1, 2, seed=3)
    config = PolicyConfig("drawn_reach", 120, 2, 1, 10.0, PictureConfig(24, 24, 1))
    write_policy(tmp_path / "policy.safetensors", config, agent)

    assert (
        main(["policy", "export", str(tmp_path / "policy.safetensors"), "--onnx", str(tmp_path / "p.onnx")])
        == 0
    )

    assert (tmp_path / "p.onnx").is_file()
    assert "p.onnx: " in (said := capsys.readouterr().out) and "differ from PyTorch's by " in said


def test_bad_input_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["policy", "export", str(tmp_path / "gone"), "--onnx", str(tmp_path / "p.onnx")]) == 2

    assert "error: the policy is missing" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
