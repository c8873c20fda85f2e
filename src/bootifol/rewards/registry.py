"""The reward methods by name, and anyone's own as `MODULE:NAME` or from an installed package (docs/add_a_method.md).

To add one to the library: a folder beside this file, whose configuration names it and its losses; its place in
`config.py`; and an entry of METHODS.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bootifol.errors import BootifolError
from bootifol.networks.backbones import Backbone, load_backbone
from bootifol.plugins import is_own_name, names_of_plugins, own_callable, plugins
from bootifol.rewards.base import RewardModel
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.rewards.config import RewardConfig
from bootifol.rewards.context_translation.model import ContextTranslationRewardModel
from bootifol.rewards.environment import EnvironmentRewardModel, SeeingEnvironmentRewardModel
from bootifol.rewards.gaifo.model import GaifoRewardModel
from bootifol.rewards.own import own_reward_model
from bootifol.rewards.virl.model import VirlRewardModel


@dataclass(frozen=True)
class Method:
    """A reward method of the library."""

    description: str
    """What it is, and whose."""

    make: Callable[..., RewardModel]
    """Its reward model, from (a section of `RewardConfig`, video_size, seed, device)."""

    section: str
    """Which section."""

    backbone: Callable[..., str | None] = lambda section: None
    """Which frozen network's features it reads instead of pixels, by its section; None where it reads pixels."""


def make_bootifol(config: BootifolConfig, video_size: int, seed: int, device: str = "cpu") -> RewardModel:
    """BootIfOL's reward model: of sequences, as in the paper, or of single frames."""
    if config.reward == "frames":
        return FrameRewardModel(config.frames, video_size, seed, device)
    return BootifolRewardModel(config, video_size, seed, device)


def make_environment_reward(
    config: BootifolConfig, video_size: int, seed: int, device: str = "cpu"
) -> RewardModel:
    """The true reward; with the eyes of BootIfOL's reward from single frames where that is configured."""
    if config.reward == "frames":
        return SeeingEnvironmentRewardModel(config.frames, video_size, seed, device)
    return EnvironmentRewardModel()


METHODS = {
    "bootifol": Method(
        "contrastive learning, bootstrapped on the agent's own failures (Djeafea Sonwa et al., 2022)",
        make_bootifol,
        "bootifol",
        lambda section: section.backbone,
    ),
    "virl": Method(
        "siamese recurrent networks, trained only while the agent acts (Berseth and Pal, 2019)",
        VirlRewardModel,
        "virl",
    ),
    "context_translation": Method(
        "expert videos translated into the agent's first frame (Liu et al., 2018)",
        ContextTranslationRewardModel,
        "context_translation",
    ),
    "gaifo": Method(
        "a discriminator on three successive frames (Torabi, Warnell and Stone, 2018)",
        GaifoRewardModel,
        "gaifo",
    ),
    "environment": Method(
        "the environment's own reward: an upper bound, not imitation", make_environment_reward, "bootifol"
    ),
}
"""Every method by name."""


def check_method(method: str) -> None:
    """Refuses a method that cannot be made, before anything is written; imports the module of one's own.

    Args:
        method: a key of METHODS, `MODULE:NAME`, or what an installed package brings.

    Raises:
        BootifolError: there is no such method, or its module cannot be imported.
    """
    if method in METHODS:
        return
    if not is_own_name(method) and method not in plugins("method"):
        raise BootifolError(
            f"there is no reward method {method!r}; choose one of {', '.join(METHODS)}{names_of_plugins('method')}, or "
            "write MODULE:NAME for one of your own"
        )
    own_callable(method, "reward method", "method")


def make_backbone(method: str, config: RewardConfig, video_size: int, device: str = "cpu") -> Backbone | None:
    """The frozen network whose features a method reads instead of pixels; None where it reads pixels.

    Args:
        method: a key of METHODS.
        config: of all methods.
        video_size: side of the videos in pixels.
        device: where to compute, as PyTorch names it.

    Raises:
        BootifolError: the backbone cannot be loaded, or cannot read videos of that size.
    """
    if method not in METHODS:
        return None
    section = getattr(config, METHODS[method].section)
    name = METHODS[method].backbone(section)
    return None if name is None else load_backbone(name, video_size, section.precision, device)


def make_reward_model(
    method: str, config: RewardConfig, video_size: int, seed: int, device: str = "cpu"
) -> RewardModel:
    """The reward model of a method.

    Args:
        method: a key of METHODS, or `MODULE:NAME` or what an installed package brings, which are called with
            (video_size, seed, device).
        config: of the methods in METHODS; one's own has its settings in its own module.
        video_size: side of the videos in pixels.
        seed: of its parameters and draws.
        device: where to compute, as PyTorch names it.

    Raises:
        BootifolError: there is no such method, or it cannot read videos of that size.
    """
    check_method(method)
    if method not in METHODS:
        return own_reward_model(method, video_size, seed, device)
    known = METHODS[method]
    return known.make(getattr(config, known.section), video_size, seed, device)
