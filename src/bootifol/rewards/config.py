"""The settings of all reward methods. Who reads them needs none of the methods."""

from __future__ import annotations

from dataclasses import dataclass, field

from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.context_translation.config import ContextTranslationConfig
from bootifol.rewards.gaifo.config import GaifoConfig
from bootifol.rewards.virl.config import VirlConfig


@dataclass(frozen=True)
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
