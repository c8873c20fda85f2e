"""A gradient step that no loss which is not finite may take."""

from __future__ import annotations

import torch
from torch import Tensor

from bootifol.errors import BootifolError


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
