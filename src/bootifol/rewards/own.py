"""Reward methods in modules of their users, named `MODULE:NAME`, and in installed packages (docs/add_a_method.md)."""

from __future__ import annotations

import inspect
from typing import cast

from bootifol.errors import BootifolError
from bootifol.plugins import own_callable, told, where
from bootifol.rewards.base import RewardModel

MEMBERS = (
    *RewardModel.__annotations__,
    *(name for name, _ in inspect.getmembers(RewardModel, inspect.isfunction) if not name.startswith("_")),
)
"""What every reward model has."""


def own_reward_model(name: str, video_size: int, seed: int, device: str) -> RewardModel:
    """The reward model that `NAME(video_size, seed, device)` of a user's module, or of a package, returns.

    Args:
        name: `MODULE:NAME`, a class or a function; or the name under which a package brings one.
        video_size: side of the videos in pixels.
        seed: of its parameters and draws.
        device: where to compute, as PyTorch names it.

    Raises:
        BootifolError: it cannot be imported, fails, lacks something that every reward model has, or reads the
            environment's reward.
    """
    make = own_callable(name, "reward method", "method")
    try:
        model = make(video_size, seed, device)
    except BootifolError:
        raise
    except (Exception, SystemExit) as error:  # somebody's class may do anything
        raise BootifolError(
            f"{name} failed when called with (video_size, seed, device): {told(error)}{where(error)}"
        ) from error
    missing = [member for member in MEMBERS if not hasattr(model, member)]
    if missing:
        raise BootifolError(
            f"{name} is no reward method: the {type(model).__name__} it makes lacks {', '.join(missing)}; "
            "bootifol.rewards.base says what each is, and LearnedRewardModel in bootifol.rewards.learned has most"
        )
    if model.reads_environment_reward:
        raise BootifolError(
            f"{name} asks for the environment's reward, which only evaluation may see: set reads_environment_reward "
            "to False, or use --method environment for an upper bound"
        )
    return cast(RewardModel, model)
