"""What can be chosen about GAIfO's discriminator; the defaults are the paper's, or its public image version's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bootifol.errors import BootifolError, require_choices


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
        require_choices("gaifo", self)
        for field, least in (
            ("stack", 2),
            ("videos_per_class", 1),
            ("stacks_per_video", 1),
            ("width_divisor", 1),
        ):
            if not getattr(self, field) >= least:
                raise BootifolError(f"gaifo: {field} is {getattr(self, field)}, but must be at least {least}")
        if self.width_divisor > 32:
            raise BootifolError(f"gaifo: width_divisor is {self.width_divisor}, but must be at most 32")
        if not 0 <= self.leak < 1:
            raise BootifolError(f"gaifo: leak is {self.leak}, but must be in [0, 1)")
        if not self.learning_rate > 0:
            raise BootifolError(f"gaifo: learning_rate is {self.learning_rate}, but must be above 0")
