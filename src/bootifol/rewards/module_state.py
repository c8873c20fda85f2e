"""Networks, their Adam and their random generator as named arrays, and back, bit for bit."""

from __future__ import annotations

import json

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from bootifol.devices import to_host
from bootifol.errors import BootifolError
from bootifol.types import Arrays

ADAM_ARRAYS = ("step", "exp_avg", "exp_avg_sq")


def module_state(module: nn.Module, optimizer: torch.optim.Adam) -> Arrays:
    """Copies: `network/<name>` for parameters and buffers, `adam/<what>/<name>` for the optimizer (once it stepped)."""
    arrays = {f"network/{name}": _array(value) for name, value in module.state_dict().items()}
    for name, parameter in module.named_parameters():
        for what, value in optimizer.state.get(parameter, {}).items():
            arrays[f"adam/{what}/{name}"] = _array(value)
    return arrays


def load_module_state(module: nn.Module, optimizer: torch.optim.Adam, arrays: Arrays) -> None:
    """The inverse of `module_state`.

    Raises:
        BootifolError: an array is missing or has another shape than this module's.
    """
    own = module.state_dict()
    for name, value in own.items():
        stored = arrays.get(f"network/{name}")
        if stored is None or stored.shape != tuple(value.shape):
            found = "is missing" if stored is None else f"has shape {list(stored.shape)}"
            raise BootifolError(
                f"the stored reward model does not fit its configuration: {name} {found}, but the configuration "
                f"makes it {list(value.shape)}; load it with the configuration of the run that stored it"
            )
    with torch.no_grad():
        for name, value in own.items():
            value.copy_(torch.from_numpy(arrays[f"network/{name}"].copy()))
    optimizer.state.clear()
    for name, parameter in module.named_parameters():
        if f"adam/step/{name}" in arrays:
            optimizer.state[parameter] = {
                what: _like(arrays[f"adam/{what}/{name}"], parameter) for what in ADAM_ARRAYS
            }


def generator_array(rng: np.random.Generator) -> NDArray[np.uint8]:
    """The generator's state as JSON in bytes."""
    return np.frombuffer(json.dumps(rng.bit_generator.state).encode(), dtype=np.uint8).copy()


def load_generator(rng: np.random.Generator, array: NDArray[np.generic]) -> None:
    """The inverse of `generator_array`."""
    rng.bit_generator.state = json.loads(array.astype(np.uint8).tobytes())


def _array(value: torch.Tensor) -> NDArray[np.generic]:
    return to_host(value.detach().clone(memory_format=torch.contiguous_format))


def _like(array: NDArray[np.generic], parameter: torch.Tensor) -> torch.Tensor:
    """The array as a tensor laid out in memory as its parameter; Adam's scalar step as it is."""
    value = torch.from_numpy(array.copy()).to(parameter.device)
    if value.ndim == 0:
        return value
    return torch.empty_like(parameter, requires_grad=False).copy_(value)
