"""Optimizers: gradient steps that no loss which is not finite may take, and what networks, Adam and random generators
keep, as named arrays and back, bit for bit.

There are two rules for a step. `GradientStep`, of reward models, is taken whole or not at all: it looks at the loss and
at the length of the gradient, and gives back the normalization statistics of the forward pass. The host waits for a GPU
once a step, when it fetches the metrics.

`take_step`, of the agent and its inverse dynamics, looks at the loss alone and never waits for a GPU, which works off
their many small steps while the host goes on. Their networks have no statistics to give back.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from bootifol.devices import to_floats, to_host
from bootifol.errors import BootifolError
from bootifol.types import Arrays, Metrics, StepMetrics


class GradientStep:
    """One step of an optimizer. Make it before the forward pass, whose normalization statistics it can undo.

    Args:
        module: what learns.
        optimizer: of all its parameters.
        number: of the step, from 1, for messages.
    """

    def __init__(self, module: nn.Module, optimizer: torch.optim.Optimizer, number: int) -> None:
        self._module = module
        self._optimizer = optimizer
        self._number = number
        self._statistics = [buffer.clone() for buffer in module.buffers()]
        optimizer.zero_grad(set_to_none=True)

    def take(self, loss: Tensor, metrics: StepMetrics) -> Metrics:
        """Follows the gradient of `loss`.

        Returns:
            The metrics, as numbers, and, as `loss/total`, the loss.

        Raises:
            BootifolError: the loss or its gradient is not finite; nothing has changed then. Names the metrics.
        """
        loss.backward()  # type: ignore[no-untyped-call]
        gradients = [p.grad for p in self._module.parameters() if p.grad is not None]
        norm = torch.nn.utils.get_total_norm(gradients)
        # The host waits for a GPU here, once a step: what it fetches decides whether the step is taken.
        *numbers, total, length = to_floats([*metrics.values(), loss, norm])
        fetched = {**dict(zip(metrics, numbers, strict=True)), "loss/total": total}
        if not np.isfinite([total, length]).all():
            for buffer, good in zip(self._module.buffers(), self._statistics, strict=True):
                buffer.copy_(good)
            told = {**fetched, "gradient norm": length} if np.isfinite(total) else fetched
            named = ", ".join(f"{name} {number:.4g}" for name, number in told.items())
            raise BootifolError(
                f"the reward model's loss is not a finite number at its gradient step {self._number} ({named}); the "
                "step was not taken: lower the reward's learning_rate in the run's config.json"
            )
        self._optimizer.step()
        return fetched


def take_step(optimizer: torch.optim.Adam, loss: Tensor, of_what: str, advice: str) -> None:
    """Follows the gradient of a loss, unless it is NaN or infinite.

    A CPU has the loss at hand and refuses it at once. On a GPU the host would have to wait for it, in the middle of an
    update: there the optimizer skips the step itself, as it does for `torch.amp.GradScaler`, and the error comes when
    the loss is logged (`tracking.Averages`).

    Args:
        optimizer: fused, of one group of parameters.
        loss: what it makes smaller, a scalar.
        of_what: names the loss in the error, such as "the agent's critic".
        advice: what to do then.

    Raises:
        BootifolError: on a CPU, where the loss is not finite; the parameters are as before.
    """
    finite = torch.isfinite(loss.detach())
    if loss.device.type != "cpu":
        optimizer.found_inf = (~finite).float()  # type: ignore[attr-defined]
    elif not finite:
        raise BootifolError(f"the loss of {of_what} is {float(loss.detach())}; {advice}")
    optimizer.zero_grad(set_to_none=True)
    # Naming the inputs spares the actor's loss the gradients of the critic's weights.
    torch.autograd.backward(loss, inputs=optimizer.param_groups[0]["params"])
    optimizer.step()


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
