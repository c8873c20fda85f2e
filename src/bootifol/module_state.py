"""Networks, what Adam keeps of them, and random generators as named arrays, and back, bit for bit."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from bootifol.devices import to_host
from bootifol.errors import BootifolError
from bootifol.types import Arrays


def module_state(module: nn.Module, optimizers: Mapping[str, torch.optim.Adam], prefix: str = "") -> Arrays:
    """Copies of parameters and buffers, and of what optimizers keep of them.

    Args:
        module: the networks.
        optimizers: of some of its parameters each, by name.
        prefix: of all names.

    Returns:
        `<prefix><name>` for parameters and buffers, `<prefix><optimizer>/<what>/<name>` once an optimizer stepped.
    """
    arrays = {f"{prefix}{name}": to_host(value).copy() for name, value in module.state_dict().items()}
    for name, parameter in module.named_parameters():
        for optimizer_name, optimizer in optimizers.items():
            for what, value in optimizer.state.get(parameter, {}).items():
                arrays[f"{prefix}{optimizer_name}/{what}/{name}"] = to_host(value).copy()
    return arrays


def load_module_state(
    module: nn.Module,
    optimizers: Mapping[str, torch.optim.Adam],
    arrays: Arrays,
    of_what: str,
    prefix: str = "",
) -> None:
    """The inverse of `module_state`; an optimizer without arrays is one that never stepped.

    Args:
        module: the networks.
        optimizers: of some of its parameters each, by name.
        arrays: what `module_state` gave, and maybe others.
        of_what: names the module in the error, such as "agent".
        prefix: of all names.

    Raises:
        BootifolError: an array is missing or has another shape than this module's; nothing has changed then.
    """
    values = {
        name: _stored(arrays, f"{prefix}{name}", value, of_what)
        for name, value in module.state_dict().items()
    }
    kept = []
    for optimizer_name, optimizer in optimizers.items():
        for name, parameter in module.named_parameters():
            if f"{prefix}{optimizer_name}/step/{name}" in arrays:
                step = torch.zeros((), device=parameter.device)
                state = {
                    what: _stored(arrays, f"{prefix}{optimizer_name}/{what}/{name}", like, of_what)
                    for what, like in {"step": step, "exp_avg": parameter, "exp_avg_sq": parameter}.items()
                }
                kept.append((optimizer, parameter, state))
    module.load_state_dict(values)
    for optimizer in optimizers.values():
        optimizer.state.clear()
    for optimizer, parameter, state in kept:
        optimizer.state[parameter] = state


def generator_array(rng: np.random.Generator) -> NDArray[np.uint8]:
    """The generator's state as JSON in bytes."""
    return np.frombuffer(json.dumps(rng.bit_generator.state).encode(), dtype=np.uint8).copy()


def load_generator(rng: np.random.Generator, array: NDArray[np.generic]) -> None:
    """The inverse of `generator_array`."""
    rng.bit_generator.state = json.loads(array.astype(np.uint8).tobytes())


def _stored(arrays: Arrays, name: str, like: torch.Tensor, of_what: str) -> torch.Tensor:
    """An array as a tensor of the device, shape and layout in memory of another."""
    array = arrays.get(name)
    if array is None or array.shape != tuple(like.shape):
        found = "is missing" if array is None else f"has shape {list(array.shape)}"
        raise BootifolError(
            f"the stored {of_what} does not fit its configuration: {name} {found}, but the configuration "
            f"makes it {list(like.shape)}; load it with the configuration of the run that stored it"
        )
    return torch.empty_like(like, requires_grad=False).copy_(torch.from_numpy(array.copy()))
