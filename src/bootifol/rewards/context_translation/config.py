"""What can be chosen about context translation; the defaults are those of its paper and its authors' release."""

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

NAME = "CT"
"""In tables and figures, as the paper has it."""

CAPTIONS = {
    "loss/translation": (
        "L_trans: videos shown in the context of another",
        "Squared error of the translated frame. Healthy: falls, rests while all translations are one blurred picture, "
        "and falls again.",
    ),
    "loss/reconstruction": (
        "L_rec: features can be drawn",
        "Squared error of a frame drawn from its own features. Healthy: falls with L_trans; equal to it, features "
        "say nothing yet.",
    ),
    "loss/alignment": (
        "L_align: translated and true features agree",
        "What makes their distance a reward. Healthy: rises when features begin to say something, then falls.",
    ),
}
"""Title and caption of each loss, for the report."""


@dataclass(frozen=True)
class ContextTranslationConfig:
    """The reward model of context translation."""

    references: int = 10
    """n: expert videos that are translated into the context of an episode and averaged; BootIfOL's paper compares
    with 10 and with 1."""

    image_weight: float = 1.0
    """w_rec: weight of the squared distance of pictures in the reward; 0 leaves it out. 1 in the release, whose
    pictures are 48x48. Both distances are sums: (48 / size)^2 / width_divisor gives either its part at other sizes."""

    reward_unit: Literal["none", "expert"] = "none"
    """none (the paper), or expert: rewards are divided by the cost that an expert frame itself has against one
    translation, averaged over the end of the Alignment Phase, so an expert gets about -1 a step whatever the size
    of pictures and features. A constant, so it changes no policy's rank."""

    reconstruction_weight: float = 1.0
    """lambda_1: weight of L_rec; 0 leaves the loss out."""

    alignment_weight: float = 0.0029
    """lambda_2: weight of L_align; 0 leaves the loss out. The release weighs sums over its 48x48 pictures against
    1000 times the mean over features in batches of 100; between means that is 0.0029."""

    pairs: int = 100
    """Pairs of expert videos in a batch."""

    frames_per_pair: int = 1
    """Time steps drawn from every pair; the release's batch has 100 pairs with one each."""

    width_divisor: int = 1
    """Divides the channels and the number of features; 1 is the paper's network."""

    leak: float = 0.2
    """Slope of LeakyReLU below zero."""

    learning_rate: float = 1e-4
    """Of Adam."""

    precision: Literal["fp32", "bf16"] = "fp32"
    """bf16 computes the networks in bfloat16; parameters, losses, rewards and Adam stay in float32."""

    def __post_init__(self) -> None:
        of_self = partial(fields_of, "context translation", self)
        require_choices("context translation", self)
        require_at_least(1, **of_self("references", "pairs", "frames_per_pair", "width_divisor"))
        require_at_least(0, **of_self("image_weight", "reconstruction_weight", "alignment_weight"))
        require_positive(**of_self("learning_rate"))
        require_below_one(**of_self("leak"))
        if self.width_divisor > 32:
            raise BootifolError(
                f"context translation: width_divisor must be at most 32, not {self.width_divisor}"
            )
