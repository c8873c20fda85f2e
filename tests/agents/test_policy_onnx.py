"""The ONNX file of a policy acts as the policy does, in onnxruntime as people start it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from bootifol.agents import policy_onnx
from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.encodings import StackedStates
from bootifol.agents.policy import Policy, PolicyConfig, read_networks, read_policy, write_policy
from bootifol.agents.policy_onnx import write_onnx
from bootifol.envs.pictures import FrameStack, PictureConfig
from bootifol.errors import BootifolError
from bootifol.networks import eyes as eyes_module
from bootifol.networks.eyes import Eyes

onnx = pytest.importorskip("onnx")
onnxruntime = pytest.importorskip("onnxruntime")
pytest.importorskip("onnxscript")

AGENT = DrQv2Config(encoder="strided", feature_dim=8, hidden_dim=16, ema_decay=0.9)
CONFIG = PolicyConfig("drawn_reach", 120, 2, action_repeat=2, frames_per_second=5.0, pictures=PictureConfig())

ROUNDING = 1e-5
"""Actions differ by a few 1e-7."""

Act = Any


def pixels_policy(path: Path, encoder: Any, stack: int) -> PolicyConfig:
    config = replace(CONFIG, pictures=PictureConfig(36, 32, stack))
    write_policy(path, config, DrQv2(replace(AGENT, encoder=encoder), 36, stack, action_dim=2, seed=3))
    return config


def states_policy(path: Path, size: int, stack: int) -> PolicyConfig:
    """One whose eyes rest, with statistics of some pictures as training leaves them."""
    config = replace(CONFIG, action_dim=3, pictures=PictureConfig(size, size, stack))
    torch.manual_seed(1)
    eyes = Eyes(size, 4)
    eyes.normalization.momentum = 1.0
    with torch.no_grad():
        eyes.train()(torch.from_numpy(np.stack([blocks(size, seed) for seed in range(64)])))
    agent = DrQv2(
        replace(AGENT, observations="states"), size, stack, 3, seed=3, encodings=StackedStates(eyes, stack)
    )
    write_policy(path, config, agent)
    return config


def session_of(path: Path) -> Act:
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return lambda stacked: session.run(["action"], {"pictures": stacked[None]})[0]


def blocks(size: int, seed: int) -> np.ndarray:
    """A picture of large blocks, on which eyes see more than on noise."""
    coarse = np.random.default_rng(seed).integers(0, 256, (4, 4, 3), np.uint8)
    return np.ascontiguousarray(
        np.kron(coarse, np.ones((size // 4 + 1, size // 4 + 1, 1), np.uint8))[:size, :size]
    )


def assert_same_actions(policy: Policy, act: Act, frames: list[np.ndarray]) -> None:
    stack = FrameStack(policy.config.pictures.stack)
    policy.reset()
    actions = []
    for frame in frames:
        acted = act(stack.add(frame))
        assert (acted.shape, acted.dtype) == ((1, policy.config.action_dim), np.float32)
        np.testing.assert_allclose(acted[0], policy.act(frame), atol=ROUNDING)
        actions.append(acted[0])
    assert np.ptp(actions, axis=0).min() > 100 * ROUNDING, "actions that are all one would agree, too"


@pytest.mark.parametrize(("encoder", "stack"), [("strided", 1), ("coarse", 3)])
def test_convolutions_act_as_the_policy(tmp_path: Path, encoder: Any, stack: int) -> None:
    config = pixels_policy(tmp_path / "policy.safetensors", encoder, stack)
    difference = write_onnx(tmp_path / "p.onnx", read_networks(tmp_path / "policy.safetensors"))

    assert difference < ROUNDING
    frames = [blocks(config.pictures.agent_size, seed) for seed in range(8)]
    assert_same_actions(read_policy(tmp_path / "policy.safetensors"), session_of(tmp_path / "p.onnx"), frames)


@pytest.mark.parametrize(("size", "stack"), [(32, 2), (64, 1)])
def test_eyes_round_in_the_file_as_they_do_here(tmp_path: Path, size: int, stack: int) -> None:
    states_policy(tmp_path / "policy.safetensors", size, stack)
    networks = read_networks(tmp_path / "policy.safetensors")
    write_onnx(tmp_path / "p.onnx", networks)

    assert isinstance(networks.see, Eyes)
    frames, seed = [], 0
    while len(frames) < 8:  # on which no state lies where a last bit decides how it is rounded
        frame, seed = blocks(size, seed), seed + 1
        with torch.inference_mode():
            steps = networks.see.eval()(torch.from_numpy(frame)[None]) * eyes_module._LEVELS
        if (steps - steps.floor() - 0.5).abs().min() > 1e-3 and steps.round().unique().numel() > 20:
            frames.append(frame)
        assert seed < 500
    assert_same_actions(read_policy(tmp_path / "policy.safetensors"), session_of(tmp_path / "p.onnx"), frames)


def test_without_rounding_eyes_would_act_otherwise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So the test above can fail."""
    states_policy(tmp_path / "policy.safetensors", 32, 2)
    monkeypatch.setattr(policy_onnx, "whole_states", lambda seen: seen * eyes_module._LEVELS)
    write_onnx(tmp_path / "p.onnx", read_networks(tmp_path / "policy.safetensors"))

    with pytest.raises(AssertionError, match="Not equal to tolerance"):
        assert_same_actions(
            read_policy(tmp_path / "policy.safetensors"),
            session_of(tmp_path / "p.onnx"),
            [blocks(32, seed) for seed in range(8)],
        )


def test_the_file_says_what_must_be_known_and_nothing_of_this_machine(tmp_path: Path) -> None:
    pixels_policy(tmp_path / "policy.safetensors", "strided", 3)
    write_onnx(tmp_path / "p.onnx", read_networks(tmp_path / "policy.safetensors"))

    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.onnx", "policy.safetensors"]
    model = onnx.load(tmp_path / "p.onnx")
    assert {prop.key: prop.value for prop in model.metadata_props} == {
        "task": "drawn_reach",
        "agent_steps": "120",
        "action_repeat": "2",
        "frames_per_second": "5",
        "picture_size": "36",
        "stack": "3",
    }
    (pictures,), (action,) = model.graph.input, model.graph.output
    sizes = [[dim.dim_value for dim in value.type.tensor_type.shape.dim] for value in (pictures, action)]
    assert sizes == [[1, 36, 36, 9], [1, 2]]
    kinds = [value.type.tensor_type.elem_type for value in (pictures, action)]
    assert kinds == [onnx.TensorProto.UINT8, onnx.TensorProto.FLOAT]
    assert b".py" not in (tmp_path / "p.onnx").read_bytes()


def test_a_runtime_that_acts_otherwise_gets_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pixels_policy(tmp_path / "policy.safetensors", "strided", 3)

    class Wrong(onnxruntime.InferenceSession):
        def run(self, *arguments: Any) -> list[Any]:
            return [-action for action in super().run(*arguments)]

    monkeypatch.setattr(onnxruntime, "InferenceSession", Wrong)
    with pytest.raises(BootifolError, match=r"onnxruntime .* acts otherwise than PyTorch \(usually by "):
        write_onnx(tmp_path / "p.onnx", read_networks(tmp_path / "policy.safetensors"))
    assert not (tmp_path / "p.onnx").exists()


@pytest.mark.parametrize("package", ["onnx", "onnxruntime", "onnxscript"])
def test_a_missing_package_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    pixels_policy(tmp_path / "policy.safetensors", "strided", 3)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(BootifolError, match=rf"the package {package}, which is missing: .* its extra `onnx`"):
        write_onnx(tmp_path / "p.onnx", read_networks(tmp_path / "policy.safetensors"))
