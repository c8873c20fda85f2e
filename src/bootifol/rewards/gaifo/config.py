"""What can be chosen about GAIfO's discriminator; the defaults are the paper's, or its public image version's."""

from __future__ import annotations

from dataclasses import dataclass

from bootifol.rewards.network_config import NetworkConfig
from bootifol.settings import Count, settings

NAME = "GAIfO"
"""In tables and figures, as the paper has it."""

CAPTIONS = {
    "loss/discriminator": (
        "L_D: expert and other stacks of frames are told apart",
        "What the discriminator does not know yet. Healthy: falls from 2 log 2 = 1.39; near 0 while the agent acts, "
        "the discriminator has won and its reward says little.",
    ),
}
"""Title and caption of each loss, for the report."""


@dataclass(frozen=True)
@settings("reward.gaifo")
class GaifoConfig(NetworkConfig):
    """GAIfO's discriminator."""

    videos_per_class: Count = 256
    """Expert videos, and as many others, from which a batch is drawn."""

    stacks_per_video: Count = 1
    """Stacks drawn from each of these videos. The public image version draws one; more read fewer videos for a
    batch of the same size."""
