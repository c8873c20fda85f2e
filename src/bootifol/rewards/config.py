"""The settings of all reward methods, and what these and their losses are called. Who reads them needs no method."""

from __future__ import annotations

from dataclasses import dataclass, field

from bootifol.rewards.bootifol import config as bootifol
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.frames import config as frames
from bootifol.rewards.context_translation import config as context_translation
from bootifol.rewards.context_translation.config import ContextTranslationConfig
from bootifol.rewards.gaifo import config as gaifo
from bootifol.rewards.gaifo.config import GaifoConfig
from bootifol.rewards.virl import config as virl
from bootifol.rewards.virl.config import VirlConfig
from bootifol.settings import settings

NAMES = {
    "bootifol": bootifol.NAME,
    "virl": virl.NAME,
    "context_translation": context_translation.NAME,
    "gaifo": gaifo.NAME,
}
"""Of the methods in tables and figures."""

CAPTIONS = {
    **bootifol.CAPTIONS,
    **frames.CAPTIONS,
    **virl.CAPTIONS,
    **context_translation.CAPTIONS,
    **gaifo.CAPTIONS,
    "loss/total": (
        "All losses together",
        "The weighted sum that is minimized. Healthy: falls at first and has no sudden jumps afterwards.",
    ),
}
"""Title and caption of each loss."""


@dataclass(frozen=True)
@settings("reward")
class RewardConfig:
    """One section a method, of its name; only the chosen method's is read."""

    bootifol: BootifolConfig = field(default_factory=BootifolConfig)
    """BootIfOL's reward model."""

    virl: VirlConfig = field(default_factory=VirlConfig)
    """ViRL's reward model."""

    context_translation: ContextTranslationConfig = field(default_factory=ContextTranslationConfig)
    """The reward model of context translation."""

    gaifo: GaifoConfig = field(default_factory=GaifoConfig)
    """GAIfO's discriminator."""
