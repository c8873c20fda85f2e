"""What can be chosen about ViRL's reward model; the defaults are those of its paper and of the public release."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bootifol.errors import BootifolError, require_choices


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

    altered_share: float = 0.5
    """Chance that an anchor's positive and negative are altered copies of itself; otherwise the positive is another
    video of its class, and the negative one of the other class. The paper's main text has both kinds and gives no
    share."""

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
        require_choices("virl", self)
        for field in ("references", "width_divisor"):
            if not getattr(self, field) >= 1:
                raise BootifolError(f"virl: {field} is {getattr(self, field)}, but must be at least 1")
        for field in ("margin", "learning_rate"):
            if not getattr(self, field) > 0:
                raise BootifolError(f"virl: {field} is {getattr(self, field)}, but must be above 0")
        for field in ("sequence_triplet", "frame_triplet", "sequence_reconstruction", "frame_reconstruction"):
            if not getattr(self, f"{field}_weight") >= 0:
                raise BootifolError(
                    f"virl: {field}_weight is {getattr(self, f'{field}_weight')}; use 0 to leave the loss out"
                )
        if not self.sequence_triplet_weight + self.frame_triplet_weight > 0:
            raise BootifolError(
                "virl: sequence_triplet_weight and frame_triplet_weight are both 0, so no distance would be learned; "
                "give one of them"
            )
        if not self.noise >= 0:
            raise BootifolError(f"virl: noise is {self.noise}; use 0 for none")
        if not 0 <= self.altered_share <= 1:
            raise BootifolError(f"virl: altered_share is {self.altered_share}, but must be in [0, 1]")
        if not 0 <= self.frame_drop < 1:
            raise BootifolError(f"virl: frame_drop is {self.frame_drop}, but must be in [0, 1)")
        if self.videos_per_class < 2:
            raise BootifolError(
                f"virl: videos_per_class is {self.videos_per_class}, but a positive is another video of its anchor's "
                "class, so it must be at least 2"
            )
        if self.frames_per_video is not None and self.frames_per_video < 1:
            raise BootifolError(
                f"virl: frames_per_video is {self.frames_per_video}; use at least 1, or none for all"
            )
        if self.width_divisor > 32:
            raise BootifolError(f"virl: width_divisor is {self.width_divisor}, but must be at most 32")
