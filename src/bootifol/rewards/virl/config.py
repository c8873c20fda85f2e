"""What can be chosen about ViRL's reward model; the defaults are those of its paper and of the public release."""

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
    require_fraction,
    require_positive,
)

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
class VirlConfig:
    """ViRL's reward model."""

    reward: Literal["both", "sequence", "frame"] = "both"
    """both (the paper): minus the distance between the encodings of agent and expert of the video so far, minus that
    of the newest frame. sequence, frame: one of the two alone, as in the paper's ablation."""

    references: int = 1
    """Expert videos an episode is compared with; the reward is the mean over them. The paper has one."""

    sequence_triplet_weight: float = 0.7
    """lambda_1, weight of L_SNS."""

    frame_triplet_weight: float = 0.1
    """lambda_2, weight of L_SNI."""

    sequence_reconstruction_weight: float = 0.1
    """lambda_3, weight of L_RAES; 0 leaves the sequence decoder out."""

    frame_reconstruction_weight: float = 0.1
    """lambda_4, weight of L_VAEI."""

    distance: Literal["euclidean", "squared"] = "euclidean"
    """d of both triplet losses. euclidean: the paper's. squared: the mean square over the dimensions, as in the public
    release; near zero it hardly has a gradient, so it takes many more steps before it learns anything."""

    margin: float = 1.0
    """rho of both triplet losses."""

    altered_fraction: float = 0.5
    """Chance that an anchor's positive and negative are altered copies of itself; otherwise the positive is another
    video of its class, and the negative one of the other class. The paper's main text has both kinds and gives no
    fraction."""

    noise: float = 0.05
    """Standard deviation of the noise added to a positive copy; pictures lie in [0, 1]."""

    early_ends: bool = True
    """Every batch is cut at one frame, more often an early one: the paper's early episode sequence priority."""

    frame_drop: float = 0.05
    """Chance that a frame index is left out of a batch, the same indices in all its videos."""

    videos_per_class: int = 8
    """n: a batch has n expert videos and n of the agent, so 2n triplets."""

    frames_per_video: int | None = None
    """Frames of each video that are reconstructed, drawn anew every step; none (the paper) means all."""

    width_divisor: int = 1
    """Divides the channels of the frame encoder and the decoder; 1 is the network of the release."""

    leak: float = 0.01
    """Slope of LeakyReLU below zero."""

    learning_rate: float = 1e-4
    """Of Adam."""

    precision: Literal["fp32", "bf16"] = "fp32"
    """bf16 computes the convolutions in bfloat16; parameters, LSTMs, losses and Adam stay in float32."""

    def __post_init__(self) -> None:
        of_self = partial(fields_of, "virl", self)
        require_choices("virl", self)
        require_at_least(1, **of_self("references", "frames_per_video", "width_divisor"))
        weights = ("sequence_triplet", "frame_triplet", "sequence_reconstruction", "frame_reconstruction")
        require_at_least(0, **of_self("noise", *(f"{loss}_weight" for loss in weights)))
        require_positive(**of_self("margin", "learning_rate"))
        require_fraction(**of_self("altered_fraction"))
        require_below_one(**of_self("frame_drop", "leak"))
        if not self.sequence_triplet_weight + self.frame_triplet_weight > 0:
            raise BootifolError(
                "virl: sequence_triplet_weight and frame_triplet_weight are both 0, so no distance would be learned; "
                "give one of them"
            )
        if self.videos_per_class < 2:
            raise BootifolError(
                f"virl: videos_per_class is {self.videos_per_class}, but a positive is another video of its anchor's "
                "class, so it must be at least 2"
            )
        if self.width_divisor > 32:
            raise BootifolError(f"virl: width_divisor must be at most 32, not {self.width_divisor}")
