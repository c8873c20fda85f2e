"""What can be chosen about context translation; the defaults are those of its paper and its authors' release."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bootifol.rewards.network_config import NetworkConfig
from bootifol.settings import Count, Number, settings

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
@settings("reward.context_translation")
class ContextTranslationConfig(NetworkConfig):
    """The reward model of context translation."""

    references: Count = 10
    """n: expert videos that are translated into the context of an episode and averaged; BootIfOL's paper compares
    with 10 and with 1."""

    image_weight: Number = 1.0
    """w_rec: weight of the squared distance of pictures in the reward; 0 leaves it out. 1 in the release, whose
    pictures are 48x48. Both distances are sums: (48 / size)^2 / width_divisor gives either its part at other sizes."""

    reward_unit: Literal["none", "expert"] = "none"
    """none (the paper), or expert: rewards are divided by the cost that an expert frame itself has against one
    translation, averaged over the end of the Alignment Phase, so an expert gets about -1 a step whatever the size
    of pictures and features. A constant, so it changes no policy's rank."""

    reconstruction_weight: Number = 1.0
    """lambda_1: weight of L_rec; 0 leaves the loss out."""

    alignment_weight: Number = 0.0029
    """lambda_2: weight of L_align; 0 leaves the loss out. The release weighs sums over its 48x48 pictures against
    1000 times the mean over features in batches of 100; between means that is 0.0029."""

    pairs: Count = 100
    """Pairs of expert videos in a batch."""

    frames_per_pair: Count = 1
    """Time steps drawn from every pair; the release's batch has 100 pairs with one each."""
