"""What can be chosen about BootIfOL's reward model; defaults are the paper's, or its release's where it is silent."""

from __future__ import annotations

from dataclasses import dataclass, field
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
from bootifol.rewards.bootifol.frames.config import FrameConfig

NAME = "BootIfOL"
"""In tables and figures, as the paper has it."""

CAPTIONS = {
    "loss/multiview": (
        "L_S: two views agree",
        "Tells whether the lightness and the color of one frame are recognized as belonging together. "
        "Healthy: falls fast, then levels off.",
    ),
    "loss/triplet": (
        "L_triplet: near in time, near in space",
        "Neighboring frames should lie closer than distant ones. Healthy: falls far below 1, its value for an "
        "encoder that sees no difference; 0 means the margin is met everywhere.",
    ),
    "loss/autoencoder": (
        "L_ae: pictures can be redrawn",
        "Squared error of the redrawn frame. Healthy: falls steadily; a plateau at the start means a blank picture.",
    ),
    "loss/prediction": (
        "L_Z: the next state is foreseen",
        "The next states, predicted from the past, against the other frames of the video. Healthy: falls and stays "
        "low; a rise in the Interactive Phase means the agent does new things.",
    ),
    "loss/sequence": (
        "L_O: expert and other videos are told apart",
        "The contrast that makes the reward. Healthy: falls in alignment, and rises again while interacting, "
        "because the agent's videos come to look like the expert's. At 0 it teaches nothing more.",
    ),
}
"""Title and caption of each loss, for the report."""


@dataclass(frozen=True)
class BootifolConfig:
    """BootIfOL's reward model."""

    reward: Literal["distance", "cosine", "frames"] = "distance"
    """distance (the paper): minus the Euclidean distance between the encodings of agent and expert.
    cosine (a version of the authors' release): their cosine similarity, in [-1, 1].
    frames (beyond the paper): how much a single frame looks like the expert's (docs/frames.md); then only the section
    `frames` is read, and what only a sequence needs is not built."""

    frames: FrameConfig = field(default_factory=FrameConfig)
    """The reward from single frames."""

    backbone: str | None = None
    """None: g_theta learns from pixels (the paper's BootIfOL). A name: g_theta is this frozen pretrained network and
    two layers that learn (Eff-BootIfOL), without L_S (there are no Lab views) and L_ae (there is no decoder), and
    with `width_divisor` and `frames_per_video` for nothing but L_triplet. efficientnet_lite0, or any vision model of
    the Hugging Face hub, such as google/efficientnet-b0 (the paper's) or facebook/dinov2-small, or a directory with
    one; most want pictures.video_size 224."""

    references: int = 1
    """Expert videos an episode is compared with; its reward is the mean at every time step. The paper has one."""

    reward_scale: Literal["none", "alignment"] = "none"
    """none (the paper), or alignment: 1 - distance / c_t, where c_t is the mean distance at time step t between
    the expert and the other (random) videos at the end of the Alignment Phase. A random episode then gets about 0
    at every step and a perfect one 1, whatever the encoder's units and however distances grow with time."""

    multiview_weight: float = 1.0
    """Weight of L_S."""

    triplet_weight: float = 1.0
    """Weight of L_triplet."""

    autoencoder_weight: float = 1.0
    """Weight of L_ae; 0 leaves the decoder out."""

    prediction_weight: float = 1.0
    """Weight of L_Z."""

    sequence_weight: float = 1.0
    """Weight of L_O."""

    sequence_times: int = 1
    """L_O is the mean over the encodings of this many prefixes, evenly spaced up to the whole video; 1, as in the
    paper, takes the whole video alone, though rewards read the encodings of all prefixes."""

    temperature: float = 0.07
    """tau of the similarity h(a, b) = exp(cos(a, b) / tau)."""

    margin: float = 1.0
    """rho of L_triplet."""

    window: int = 2
    """L_triplet: a positive is at most this many frames from its anchor, a negative is farther."""

    predicted_states: int = 2
    """K of L_Z: how many states are predicted, each from the one before."""

    frame_drop: float = 0.05
    """Chance that a frame index is left out of a batch, the same indices in all its videos."""

    videos_per_class: int = 16
    """n: a batch has n expert videos and n others."""

    time_corrupted_fraction: float = 0.0
    """Beyond the paper: fraction of the other videos that are expert videos corrupted in time (`time_corrupted.py`); 0,
    as in the paper, none."""

    frames_per_video: int | None = None
    """Frames of each video on which L_S, L_triplet and L_ae are computed, drawn anew every step; none (the paper)
    means all. L_Z and L_O always read every frame."""

    width_divisor: int = 1
    """Divides the channels of the frame encoders and the decoder; 1 is the paper's network."""

    motion: bool = False
    """Beyond the paper: f also reads how the state changed since the frame before; false is the paper's network."""

    leak: float = 0.2
    """Slope of LeakyReLU below zero."""

    learning_rate: float = 1e-4
    """Of Adam."""

    precision: Literal["fp32", "bf16"] = "fp32"
    """bf16 computes the convolutions in bfloat16; parameters, LSTM, losses and Adam stay in float32."""

    def __post_init__(self) -> None:
        of_self = partial(fields_of, "bootifol", self)
        require_choices("bootifol", self)
        counts = (
            "references",
            "sequence_times",
            "predicted_states",
            "window",
            "frames_per_video",
            "width_divisor",
        )
        require_at_least(1, **of_self(*counts))
        losses = ("multiview", "triplet", "autoencoder", "prediction", "sequence")
        require_at_least(0, **of_self("margin", *(f"{loss}_weight" for loss in losses)))
        require_positive(**of_self("temperature", "learning_rate"))
        require_below_one(**of_self("time_corrupted_fraction", "frame_drop", "leak"))
        of_backbone = ("triplet", "prediction", "sequence")
        learned = of_backbone if self.backbone else losses
        if not any(getattr(self, f"{loss}_weight") for loss in learned):
            raise BootifolError(
                f"bootifol: {', '.join(f'{loss}_weight' for loss in learned)} are all 0, so nothing would be learned; "
                "give one of them"
            )
        if self.reward == "frames" and self.backbone is not None:
            raise BootifolError(
                "bootifol: reward frames has eyes of its own and reads no backbone; leave one of them out, or take "
                "reward distance and an agent that reads pictures, as --preset cpu does"
            )
        if self.videos_per_class < 2:
            raise BootifolError(
                f"bootifol: videos_per_class is {self.videos_per_class}, but L_O compares an expert video "
                "with another one, so it must be at least 2"
            )
        if self.width_divisor > 32:
            raise BootifolError(f"bootifol: width_divisor must be at most 32, not {self.width_divisor}")
        if self.reward_scale == "alignment" and self.reward == "cosine":
            raise BootifolError(
                "bootifol: reward_scale alignment is for the distance reward; the cosine lies in [-1, 1] already, "
                "so use reward_scale none"
            )
