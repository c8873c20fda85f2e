"""One gradient step that is taken only where loss and gradient are finite numbers."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from bootifol.errors import BootifolError
from bootifol.types import Metrics


def gradient_step(
    networks: nn.Module, optimizer: torch.optim.Optimizer, loss: torch.Tensor, metrics: Metrics, number: int
) -> None:
    """Back-propagates the loss and lets the optimizer take the step.

    Args:
        networks: whose gradients are cleared first.
        optimizer: of their parameters.
        loss: a scalar.
        metrics: named in the error.
        number: of this step, counted from 1, named in the error.

    Raises:
        BootifolError: the loss or a gradient is not finite; the parameters are then what they were.
    """
    networks.zero_grad(set_to_none=True)
    _refuse_if_not_finite(float(loss.detach()), number, metrics)
    loss.backward()  # type: ignore[no-untyped-call]
    gradients = [p.grad for p in networks.parameters() if p.grad is not None]
    norm = float(torch.nn.utils.get_total_norm(gradients))
    _refuse_if_not_finite(norm, number, {**metrics, "gradient norm": norm})
    optimizer.step()


def _refuse_if_not_finite(value: float, number: int, metrics: Metrics) -> None:
    if not np.isfinite(value):
        named = ", ".join(f"{name} {metric:.4g}" for name, metric in metrics.items())
        raise BootifolError(
            f"the reward model's loss is not a finite number at its gradient step {number} ({named}); the step "
            "was not taken: go on from the last checkpoint with a smaller learning rate"
        )
