"""What can be chosen about GAIfO's discriminator; the defaults are the paper's, or its public image version's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

from bootifol.errors import (
    BootifolError,
    fields_of,
    require_at_least,
    require_below_one,
    require_choices,
    require_positive,
)

NAME = "GAIfO"
"""In tables and figures, as the paper has it."""

CAPTIONS = {
    "loss/discriminator": (
        "L_D: expert and other stacks of frames are told apart",
        "What the discriminator does not know yet. Healthy: falls from 2 log 2 = 1.39; near 0 while the agent acts, "
        "the discriminator has won and its reward says little.",
    ),
}
"""Title and caption of each loss, for the report."""


@dataclass(frozen=True)
class GaifoConfig:
    """GAIfO's discriminator."""

    reward: Literal["softplus", "log_sigmoid", "logit"] = "softplus"
    """What of the logit x rewards a step, where D = sigmoid(x) is the chance that the expert made it.
    softplus (the paper and the public image version): -log(1 - D), never below 0. log_sigmoid: log D, never
    above 0. logit: x, their sum, which has the same slope wherever the discriminator is sure."""

    stack: int = 3
    """Successive frames that the discriminator sees at once."""

    videos_per_class: int = 256
    """Expert videos, and as many others, from which a batch is drawn."""

    stacks_per_video: int = 1
    """Stacks drawn from each of these videos. The public image version draws one; more read fewer videos for a
    batch of the same size."""

    width_divisor: int = 1
    """Divides the channels of the 5x5 convolutions; 1 is the public image version's network."""

    leak: float = 0.01
    """Slope of LeakyReLU below zero."""

    learning_rate: float = 1e-4
    """Of Adam."""

    precision: Literal["fp32", "bf16"] = "fp32"
    """bf16 computes the network in bfloat16; parameters, losses and Adam stay in float32."""

    def __post_init__(self) -> None:
        of_self = partial(fields_of, "gaifo", self)
        require_choices("gaifo", self)
        counts = ("videos_per_class", "stacks_per_video", "width_divisor")
        require_at_least(1, **of_self(*counts))
        require_at_least(2, **of_self("stack"))
        require_positive(**of_self("learning_rate"))
        require_below_one(**of_self("leak"))
        if self.width_divisor > 32:
            raise BootifolError(f"gaifo: width_divisor must be at most 32, not {self.width_divisor}")
