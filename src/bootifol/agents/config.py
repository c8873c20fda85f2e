"""Hyperparameters of the agent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bootifol.settings import (
    BelowOne,
    Count,
    CountOrZero,
    Flag,
    Fraction,
    Number,
    Positive,
    Precision,
    settings,
)

EncoderName = Literal["paper", "strided", "coarse"]
Observations = Literal["pictures", "encodings", "states"]


@dataclass(frozen=True)
@settings("agent")
class DrQv2Config:
    """DrQ-v2; the defaults are those of its paper, with the replay of BootIfOL's release."""

    observations: Observations = "pictures"
    """pictures: convolutions of the agent's own read the frames (the paper's agent). encodings: an MLP reads what the
    reward model's frame encoder makes of them, always its newest version and without a random shift (the paper's
    ablation of it); for reward methods that encode single frames. states (beyond the paper): the trunks read what
    eyes that rest make of the frames; replay keeps that instead of pictures, and an update has no convolutions."""

    encoder: EncoderName = "paper"
    """Convolutions over the frame stack. paper: four 3x3 layers of 32 channels, strides 2, 1, 1, 1.
    strided: the same with strides 2, 2, 1, 1. coarse: 8x8 stride 4, 4x4 stride 2, 3x3 (32, 64, 64 channels),
    the cheapest."""

    feature_dim: Count = 50
    """Width of the trunks between the encoder and the actor's and critic's heads."""

    hidden_dim: Count = 1024
    """Width of the two hidden layers of the actor and of each critic."""

    critic_norm: Flag = False
    """Beyond DrQ-v2: LayerNorm after the critics' hidden layers, which keeps Q in bounds where rewards move."""

    batch_size: Count = 256
    """Transitions an update learns from."""

    update_every: Count = 2
    """Agent steps an update."""

    n_step: Count = 3
    """Rewards summed before bootstrapping."""

    discount: Fraction = 0.99
    """Discount of future rewards an agent step."""

    learning_rate: Positive = 1e-4
    """Of Adam, for encoder, critic and actor."""

    tau: Fraction = 0.01
    """How far the target critic moves to the critic at each update (tau)."""

    exploration_start: Number = 1.0
    """Standard deviation of the action noise at the first agent step."""

    exploration_end: Number = 0.1
    """Standard deviation of the action noise once exploration_steps have passed."""

    exploration_steps: CountOrZero = 500_000
    """Agent steps over which the noise falls linearly."""

    noise_clip: Number = 0.3
    """Largest noise on the actions that the losses evaluate; the actions taken are not so limited."""

    warm_up_steps: CountOrZero = 1920
    """Agent steps of uniformly random actions before the first update; the Interactive Phase draws them."""

    warm_up_hold: Count = 1
    """Largest number of agent steps that a random action of the warm-up is repeated for, drawn anew each time. 1, as
    in the paper, never. Held actions reach speeds that trembling does not, and inverse dynamics needs to see them."""

    replay_capacity: Count = 100_000
    """Frames that replay holds; an episode of T transitions takes T + 1."""

    random_shift: CountOrZero = 4
    """Largest random shift of the pictures in pixels."""

    saturation_weight: Number = 0.0
    """Beyond DrQ-v2: weight of `saturation_loss` beside the actor's; 0, as in its paper, leaves it out. Where tanh is
    saturated no gradient passes, and an actor that early estimates sent into a corner never comes back."""

    cloning_weight: Number = 0.0
    """Beyond the paper: how strongly actor and encoder are pulled to the inferred actions of expert videos, relative
    to the mean of |Q| or 1, whichever is larger; 0, as in the paper, not at all. Needs `demonstrations`."""

    ema_decay: BelowOne = 0.0
    """Beyond DrQ-v2: without exploration the policy acts with running averages of encoder and actor, which keep this
    fraction of themselves at each update and so even out the noise of the last ones; 0, as in its paper, the newest.
    Until 1 / (1 - ema_decay) updates they are plain means, in which nothing is left of the initial parameters."""

    precision: Precision = "fp32"
    """Arithmetic of convolutions and matrix products, also of the inverse dynamics; parameters, losses and Q values are
    always float32."""

    def exploration(self, agent_steps: float) -> float:
        """Standard deviation of the noise after so many agent steps."""
        passed = min(agent_steps / self.exploration_steps, 1.0) if self.exploration_steps else 1.0
        return self.exploration_start + passed * (self.exploration_end - self.exploration_start)
