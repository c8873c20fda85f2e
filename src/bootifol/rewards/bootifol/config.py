"""What can be chosen about BootIfOL's reward model; defaults are the paper's, or its release's where it is silent."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from bootifol.errors import BootifolError
from bootifol.rewards.bootifol.frames.config import FrameConfig
from bootifol.rewards.network_config import NetworkConfig
from bootifol.settings import AtLeastTwo, BelowOne, Count, Flag, Number, Positive, settings

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
@settings("reward.bootifol")
class BootifolConfig(NetworkConfig):
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

    references: Count = 1
    """Expert videos an episode is compared with; its reward is the mean at every time step. The paper has one."""

    reward_scale: Literal["none", "alignment"] = "none"
    """none (the paper), or alignment: 1 - distance / c_t, where c_t is the mean distance at time step t between
    the expert and the other (random) videos at the end of the Alignment Phase. A random episode then gets about 0
    at every step and a perfect one 1, whatever the encoder's units and however distances grow with time."""

    multiview_weight: Number = 1.0
    """Weight of L_S."""

    triplet_weight: Number = 1.0
    """Weight of L_triplet."""

    autoencoder_weight: Number = 1.0
    """Weight of L_ae; 0 leaves the decoder out."""

    prediction_weight: Number = 1.0
    """Weight of L_Z."""

    sequence_weight: Number = 1.0
    """Weight of L_O."""

    sequence_times: Count = 1
    """L_O is the mean over the encodings of this many prefixes, evenly spaced up to the whole video; 1, as in the
    paper, takes the whole video alone, though rewards read the encodings of all prefixes."""

    temperature: Positive = 0.07
    """tau of the similarity h(a, b) = exp(cos(a, b) / tau)."""

    margin: Number = 1.0
    """rho of L_triplet."""

    window: Count = 2
    """L_triplet: a positive is at most this many frames from its anchor, a negative is farther."""

    predicted_states: Count = 2
    """K of L_Z: how many states are predicted, each from the one before."""

    frame_drop: BelowOne = 0.05
    """Chance that a frame index is left out of a batch, the same indices in all its videos."""

    videos_per_class: AtLeastTwo = 16
    """n: a batch has n expert videos and n others."""

    frames_per_video: Count | None = None
    """Frames of each video on which L_S, L_triplet and L_ae are computed, drawn anew every step; none (the paper)
    means all. L_Z and L_O always read every frame."""

    motion: Flag = False
    """Beyond the paper: f also reads how the state changed since the frame before; false is the paper's network."""

    def __post_init__(self) -> None:
        of_backbone = ("triplet", "prediction", "sequence")
        losses = of_backbone if self.backbone else ("multiview", "autoencoder", *of_backbone)
        if not any(getattr(self, f"{loss}_weight") for loss in losses):
            raise BootifolError(
                f"reward.bootifol: {', '.join(f'{loss}_weight' for loss in losses)} are all 0, so nothing would be "
                "learned; give one of them"
            )
        if self.reward == "frames" and self.backbone is not None:
            raise BootifolError(
                "reward.bootifol: reward frames has eyes of its own and reads no backbone; leave one of them out, or "
                "take reward distance and an agent that reads pictures, as --preset cpu does"
            )
        if self.reward_scale == "alignment" and self.reward == "cosine":
            raise BootifolError(
                "reward.bootifol: reward_scale alignment is for the distance reward; the cosine lies in [-1, 1] "
                "already, so use reward_scale none"
            )
