"""A gradient step that is taken whole or not at all."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

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

    def take(self, loss: torch.Tensor, metrics: StepMetrics) -> Metrics:
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
