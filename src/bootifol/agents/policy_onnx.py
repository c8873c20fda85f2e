"""A policy as one ONNX file, for programs that have neither Python nor PyTorch.

    pictures  uint8 [1, S, S, 3 * stack]   RGB of the newest frames along the last axis, oldest first
    action    float32 [1, A]               in [-1, 1]

The file's metadata say what else must be known: task, rate, sizes.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from bootifol.agents.policy import PolicyConfig, PolicyNetworks
from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.networks.eyes import Eyes, as_features, whole_states

PICTURES, ACTION = "pictures", "action"
"""Names of input and output."""

OPSET = 18
"""Version of ONNX's operators: the oldest that PyTorch's exporter writes, so that older runtimes read it, too."""

TRIED = 20
"""Random stacks of pictures on which the file is tried."""

SAME = 1e-4
"""Actions that differ by less are the same up to rounding; theirs is a few 1e-7."""


class StackToAction(nn.Module):
    """A stack of pictures to an action, as `Policy.act` has them; eyes round what they see, as there.

    Args:
        networks: of the policy; they are set to evaluation.
    """

    def __init__(self, networks: PolicyNetworks) -> None:
        super().__init__()
        self.see, self.decide = networks.see, networks.decide
        self._stack = networks.config.pictures.stack
        self.eval()

    def forward(self, pictures: Tensor) -> Tensor:
        """Actions float32 `[1, A]` of pictures uint8 `[1, S, S, 3 * stack]`."""
        if isinstance(self.see, Eyes):
            size = pictures.shape[1]
            frames = pictures.reshape(size, size, self._stack, 3).permute(2, 0, 1, 3)
            features = as_features(whole_states(self.see(frames))).reshape(1, -1)
        else:
            features = self.see(pictures.permute(0, 3, 1, 2).float())
        action: Tensor = self.decide(features)
        return action


def write_onnx(path: Path, networks: PolicyNetworks) -> float:
    """Writes one ONNX file with the weights in it, once onnxruntime does what the networks do.

    Args:
        path: the file.
        networks: of the policy, from `read_networks`.

    Returns:
        The largest difference between an action of onnxruntime and one of PyTorch, over `TRIED` random stacks.

    Raises:
        BootifolError: the packages of the extra `onnx` are missing, onnxruntime acts otherwise, or the file cannot be
            written.
    """
    onnx, runtime = _libraries()
    acting = StackToAction(networks)
    config = networks.config
    size, channels = config.pictures.agent_size, 3 * config.pictures.stack
    example = torch.zeros(1, size, size, channels, dtype=torch.uint8)
    with _quiet_exporter():
        program = torch.onnx.export(
            acting,
            (example,),
            input_names=[PICTURES],
            output_names=[ACTION],
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    model = program.model_proto
    for described in (model.graph, *model.graph.node, *model.graph.value_info):
        del described.metadata_props[:]  # which lines of which files of this machine made it
    onnx.helper.set_model_props(model, metadata(config))
    model.producer_name = "bootifol"
    onnx.checker.check_model(model)
    data: bytes = model.SerializeToString()
    difference = _require_same_actions(runtime, data, acting, tuple(example.shape))
    with written_aside(path) as aside:
        aside.write_bytes(data)
    return difference


def _require_same_actions(runtime: Any, data: bytes, acting: StackToAction, shape: tuple[int, ...]) -> float:
    """The largest difference from the networks' actions.

    A state that lies halfway between two whole numbers may be rounded to either, which moves an action by thousandths;
    so the usual difference is what is judged.
    """
    session = runtime.InferenceSession(data, providers=["CPUExecutionProvider"])
    generator = np.random.default_rng(0)
    differences = []
    for _ in range(TRIED):
        pictures = generator.integers(0, 256, shape, np.uint8)
        with torch.inference_mode():
            expected = acting(torch.from_numpy(pictures)).numpy()
        differences.append(float(np.abs(session.run([ACTION], {PICTURES: pictures})[0] - expected).max()))
    if not np.median(differences) < SAME:
        raise BootifolError(
            f"onnxruntime {runtime.__version__} acts otherwise than PyTorch (usually by {np.median(differences):.2g}), "
            "so no file was written: take another version of onnxruntime, and please report this one"
        )
    return max(differences)


def metadata(config: PolicyConfig) -> dict[str, str]:
    """What the file says about the policy, by name."""
    return {
        "task": config.task,
        "agent_steps": str(config.agent_steps),
        "action_repeat": str(config.action_repeat),
        "frames_per_second": f"{config.frames_per_second:g}",
        "picture_size": str(config.pictures.agent_size),
        "stack": str(config.pictures.stack),
    }


@contextmanager
def _quiet_exporter() -> Iterator[None]:
    """Without what PyTorch's exporter says about parts of its own that no policy has."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _libraries() -> tuple[Any, Any]:
    """The modules `onnx` and `onnxruntime`."""
    try:
        import onnx
        import onnxruntime
        import onnxscript  # noqa: F401  (PyTorch's exporter needs it)
    except ImportError as error:
        raise BootifolError(
            f"an ONNX file needs the package {error.name}, which is missing: install bootifol with its extra `onnx`, "
            "or `pip install onnx onnxruntime onnxscript`"
        ) from error
    return onnx, onnxruntime
