"""What can be chosen about ViRL's reward model; the defaults are those of its paper and of the public release."""

from __future__ import annotations

from dataclasses import dataclass

from bootifol.errors import BootifolError
from bootifol.rewards.network_config import NetworkConfig
from bootifol.settings import AtLeastTwo, Count, Number, settings

NAME = "ViRL"
"""In tables and figures, as the paper has it."""

CAPTIONS = {
    "loss/sequence_triplet": (
        "L_SNS: alike videos are near, others far",
        "Distances between encodings of whole videos, which make the reward with those of frames. Healthy: starts at "
        "1, since all encodings are nearly one, and falls clearly below it.",
    ),
    "loss/frame_triplet": (
        "L_SNI: alike frames are near, others far",
        "The same of single frames. Healthy: falls where a single frame tells expert from agent, and stays near 1 "
        "where it does not.",
    ),
    "loss/sequence_reconstruction": (
        "L_RAES: videos can be redrawn",
        "Squared error of frames unrolled from the encoding of their video. Healthy: falls fast, then slowly.",
    ),
    "loss/frame_reconstruction": (
        "L_VAEI: frames can be redrawn",
        "Squared error of a frame redrawn from its own encoding. Healthy: falls fast, then slowly.",
    ),
}
"""Title and caption of each loss, for the report."""


@dataclass(frozen=True)
@settings("reward.virl")
class VirlConfig(NetworkConfig):
    """ViRL's reward model."""

    references: Count = 1
    """Expert videos an episode is compared with; the reward is the mean over them. The paper has one."""

    sequence_triplet_weight: Number = 0.7
    """lambda_1, weight of L_SNS."""

    frame_triplet_weight: Number = 0.1
    """lambda_2, weight of L_SNI."""

    sequence_reconstruction_weight: Number = 0.1
    """lambda_3, weight of L_RAES; 0 leaves the sequence decoder out."""

    frame_reconstruction_weight: Number = 0.1
    """lambda_4, weight of L_VAEI."""

    videos_per_class: AtLeastTwo = 8
    """n: a batch has n expert videos and n of the agent, so 2n triplets."""

    frames_per_video: Count | None = None
    """Frames of each video that are reconstructed, drawn anew every step; none (the paper) means all."""

    def __post_init__(self) -> None:
        if not self.sequence_triplet_weight + self.frame_triplet_weight > 0:
            raise BootifolError(
                "reward.virl: sequence_triplet_weight and frame_triplet_weight are both 0, so no distance would be "
                "learned; give one of them"
            )
