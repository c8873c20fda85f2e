"""What can be chosen about the reward that sees single frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, Strict

from bootifol.settings import AtLeastTwo, Count, Fraction, Number, Positive, settings

CAPTIONS = {
    "loss/frame": (
        "L_F: the expert's frames are told from others",
        "Healthy: falls below 0.4 once the goal is seen. Early frames that count in part keep it above 0.",
    ),
    "loss/episode": (
        "L_E: what stays through an episode is told apart",
        "Two moments of a video against other videos. Healthy: falls far where goals differ, little where nothing but "
        "the start does.",
    ),
    "loss/time": (
        "L_T: moments of a video are told apart",
        "Neighboring frames against other moments of the same video. Healthy: falls steadily.",
    ),
    "loss/exchange": (
        "L_X: halves of two videos do not go together",
        "An expert's motion with another video's goal is a failure. Healthy: falls where goals differ.",
    ),
    "loss/bootstrap": (
        "L_B: the agent's frames lose",
        "The mean chance that the head gives the agent's frames. Healthy: falls at first, and rises as the agent gets "
        "better.",
    ),
}
"""Title and caption of each loss, for the report."""


@dataclass(frozen=True)
@settings("reward.bootifol.frames")
class FrameConfig:
    """The frame contrast, its eyes and its head; read where the reward is `frames`."""

    frame_weight: Number = 0.5
    """Weight of L_F, which tells the expert's frames from others."""

    late_from: Fraction = 0.5
    """c of L_F: the part of an expert video after which a frame counts as the expert's in full; before it, the less the
    earlier it is. 0 counts every frame alike."""

    episode_weight: Number = 0.3
    """Weight of L_E, which tells what is one episode's alone: where its goal lies. 0 leaves it out."""

    time_weight: Number = 0.5
    """Weight of L_T, which tells the moments of one video apart. 0 leaves it out."""

    exchange_weight: Number = 0.0
    """Weight of L_X, which tells halves of one video's states from halves of two. 0 leaves it out."""

    agent_weight: Number = 0.2
    """Weight of L_B, by which the agent's frames bootstrap the head in the Interactive Phase."""

    temperature: Positive = 0.1
    """tau of L_E and L_T."""

    videos_per_class: AtLeastTwo = 16
    """Videos of either class in a gradient step of the Alignment Phase."""

    moments: AtLeastTwo = 3
    """Moments of each of them in it; of each, a frame and one next to it."""

    frames_per_class: AtLeastTwo = 96
    """Frames of either class in a gradient step of the Interactive Phase."""

    random_fraction: Fraction = 0.33
    """Fraction of random videos among the frames that are not the expert's in the Interactive Phase; the rest is the
    agent's. There is one of these at least."""

    width: Count = 16
    """Features of a cell of the eyes' map."""

    noise: Number = 0.2
    """Standard deviation of the noise on the states (of variance about 1) that the head learns from in the Interactive
    Phase. Less of it, and the head tells the agent's successes from the expert's by how they differ in detail, and
    takes their reward away; more, and it rewards near misses."""

    floor: Annotated[float, Strict(), Field(ge=-1, le=0)] = -1.0
    """b: the least that a frame can get. With 0 all that looks more like a failure than like the expert is worth the
    same, nothing: less to follow, and no second best to settle for."""

    learning_rate: Positive = 1e-3
    """Of Adam in the Alignment Phase."""

    head_learning_rate: Positive = 3e-4
    """Of Adam in the Interactive Phase."""
