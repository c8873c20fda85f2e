"""A bundled expert: a small network from the simulator's state to an action, in a safetensors file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bootifol.errors import BootifolError
from bootifol.files import read_arrays, write_arrays
from bootifol.types import Action, Arrays

Layer = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Weights `[outputs, inputs]` and biases `[outputs]`."""


class StatePolicy:
    """Linear layers with a ReLU between them and tanh at the end; numpy alone computes it.

    Args:
        layers: first to last; the last one's outputs are the action dimensions.
    """

    def __init__(self, layers: Sequence[Layer]) -> None:
        self.layers = [
            (np.asarray(weight, np.float64), np.asarray(bias, np.float64)) for weight, bias in layers
        ]

    def __call__(self, state: NDArray[np.floating]) -> Action:
        """The action `[A]` in [-1, 1] for a state `[S]`; the same state always gives the same one."""
        hidden = np.asarray(state, np.float64)
        *inner, (last_weight, last_bias) = self.layers
        for weight, bias in inner:
            hidden = np.maximum(weight @ hidden + bias, 0.0)
        action: Action = np.tanh(last_weight @ hidden + last_bias).astype(np.float32)
        return action

    def save(self, path: Path) -> None:
        """Writes `<n>.weight` and `<n>.bias` in float32, whole or not at all."""
        arrays: Arrays = {}
        for number, (weight, bias) in enumerate(self.layers):
            arrays[f"{number}.weight"] = weight.astype(np.float32)
            arrays[f"{number}.bias"] = bias.astype(np.float32)
        write_arrays(path, arrays)

    @classmethod
    def load(cls, path: Path) -> StatePolicy:
        """Reads what `save` wrote.

        Raises:
            BootifolError: the file is missing, damaged or holds no such network.
        """
        arrays = read_arrays(path, "the expert's policy")
        count = len(arrays) // 2
        names = {f"{number}.{part}" for number in range(count) for part in ("weight", "bias")}
        if not arrays or names != arrays.keys():
            raise BootifolError(f"{path} holds no expert's policy: its arrays are {', '.join(arrays)}")
        layers = [
            tuple(arrays[f"{number}.{part}"].astype(np.float64) for part in ("weight", "bias"))
            for number in range(count)
        ]
        return cls([(weight, bias) for weight, bias in layers])
