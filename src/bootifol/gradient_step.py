"""Gradient steps that no loss which is not finite may take, by two rules.

`GradientStep`, of reward models, is taken whole or not at all: it looks at the loss and at the length of the gradient,
and gives back the normalization statistics of the forward pass. The host waits for a GPU once a step, when it fetches
the metrics.

`take_step`, of the agent and its inverse dynamics, looks at the loss alone and never waits for a GPU, which works off
their many small steps while the host goes on. Their networks have no statistics to give back.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from bootifol.devices import to_floats
from bootifol.errors import BootifolError
from bootifol.types import Metrics, StepMetrics


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
        try:
            self._refuse_if_not_finite(total, fetched)
            self._refuse_if_not_finite(length, {**fetched, "gradient norm": length})
        except BootifolError:
            for buffer, good in zip(self._module.buffers(), self._statistics, strict=True):
                buffer.copy_(good)
            raise
        self._optimizer.step()
        return fetched

    def _refuse_if_not_finite(self, value: float, metrics: Metrics) -> None:
        if not np.isfinite(value):
            named = ", ".join(f"{name} {number:.4g}" for name, number in metrics.items())
            raise BootifolError(
                f"the reward model's loss is not a finite number at its gradient step {self._number} ({named}); the "
                "step was not taken: lower the reward's learning_rate in the run's config.json"
            )


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
