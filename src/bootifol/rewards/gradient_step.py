"""One gradient step of a reward model, taken only where loss and gradient are finite."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch import nn

from bootifol.errors import BootifolError
from bootifol.types import Metrics


@contextmanager
def statistics_kept_if_refused(networks: nn.Module) -> Iterator[None]:
    """Gives BatchNorm's statistics (all buffers) back as they were where the step inside is refused."""
    statistics = [buffer.clone() for buffer in networks.buffers()]
    try:
        yield
    except BootifolError:
        for buffer, good in zip(networks.buffers(), statistics, strict=True):
            buffer.copy_(good)
        raise


def take_step(
    networks: nn.Module, optimizer: torch.optim.Optimizer, total: torch.Tensor, metrics: Metrics, version: int
) -> None:
    """Goes down the gradient of `total` once.

    Args:
        networks: whose parameters the optimizer holds.
        optimizer: takes the step.
        total: the loss, a scalar.
        metrics: its terms, which the sentence of an error names.
        version: steps taken before this one.

    Raises:
        BootifolError: the loss or its gradient is not finite; the parameters stay as they were.
    """
    _refuse_if_not_finite(float(total.detach()), version, metrics)
    optimizer.zero_grad(set_to_none=True)
    total.backward()  # type: ignore[no-untyped-call]
    gradients = [p.grad for p in networks.parameters() if p.grad is not None]
    norm = float(torch.nn.utils.get_total_norm(gradients))
    _refuse_if_not_finite(norm, version, {**metrics, "gradient norm": norm})
    optimizer.step()


def _refuse_if_not_finite(value: float, version: int, metrics: Metrics) -> None:
    if not np.isfinite(value):
        named = ", ".join(f"{name} {number:.4g}" for name, number in metrics.items())
        raise BootifolError(
            f"the reward model's loss is not a finite number at its gradient step {version + 1} ({named}); the step "
            "was not taken: go on from the last checkpoint with a smaller learning rate"
        )
