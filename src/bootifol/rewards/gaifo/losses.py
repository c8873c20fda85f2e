"""The loss of GAIfO and its reward: pure functions of logits, one equation each.

Notation: x is the discriminator's logit of a stack of frames and `D = sigmoid(x)` the chance that the expert made
it. The paper's D is the chance that the imitator made it, that is `1 - D` here; the equations are written with ours.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F


def discriminator_loss(expert: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """L_D: the discriminator tells the expert's stacks from others (GAIfO, Algorithm 1).

    `L_D = -E_expert[ log D ] - E_other[ log(1 - D) ]`

    It is 2 log 2 for a discriminator that knows nothing.

    Args:
        expert: logits `[N]` of the expert's stacks.
        other: logits `[M]` of the agent's, or during alignment of random, stacks.
    """
    return F.softplus(-expert.float()).mean() + F.softplus(other.float()).mean()


def reward(logits: torch.Tensor) -> torch.Tensor:
    """`-log(1 - D)`, what the agent gets for the stacks it made (the paper and the public image version): float32 of
    the logits' shape, never below 0.
    """
    return F.softplus(logits.float())
