"""Expert videos as experience: with inferred actions and learned rewards they enter the agent's batches.

This goes beyond the paper, and is off by default. The agent's own steps teach an inverse-dynamics model which action
leads from one picture to the next; it names the actions of the expert videos, the learned reward rewards them, and a
share of every batch is drawn from them. Nobody gave an action or a reward: both are inferred from pictures.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from bootifol.agents.inverse_dynamics import InverseDynamics
from bootifol.envs.pictures import resize
from bootifol.errors import BootifolError, require_at_least
from bootifol.evaluation.ranking import draw_references
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.base import RewardModel
from bootifol.types import Arrays, Batch, Episode, Frames, Metrics, VideoSource


@dataclass(frozen=True)
class DemonstrationConfig:
    """Expert videos as the agent's experience (beyond the paper)."""

    share: float = 0.0
    """Share of each batch that is drawn from expert videos; 0, as in the paper, uses none."""

    videos: int = 300
    """Expert videos used so, at most; they take replay's memory a second time."""

    first_updates: int = 2000
    """Gradient steps of the inverse dynamics when the agent's warm-up ends."""

    updates: int = 200
    """Gradient steps of the inverse dynamics at each later refresh."""

    refresh_every: int = 2000
    """Agent steps between two refreshes: the inverse dynamics learns from newer steps, and every demonstration gets
    its actions and rewards anew."""

    batch_size: int = 128
    """Transitions of a gradient step of the inverse dynamics."""

    def __post_init__(self) -> None:
        if not 0 <= self.share < 1:
            raise BootifolError(f"demonstrations: share must be in [0, 1), not {self.share}")
        names = ("videos", "first_updates", "updates", "refresh_every", "batch_size")
        require_at_least(1, **{f"demonstrations.{name}": getattr(self, name) for name in names})


class Demonstrations:
    """Expert videos with inferred actions, as a second replay beside the agent's.

    Args:
        config: see there; `share` must be above 0.
        expert: D_e.
        replay: of the expert videos; empty, and large enough for them.
        inverse_dynamics: what infers the actions.
        frame_size: size of the agent's pictures.
    """

    def __init__(
        self,
        config: DemonstrationConfig,
        expert: VideoSource,
        replay: ReplayBuffer,
        inverse_dynamics: InverseDynamics,
        frame_size: int,
    ) -> None:
        self.config = config
        self.expert = expert
        self.replay = replay
        self.inverse_dynamics = inverse_dynamics
        self.frame_size = frame_size
        self.count = min(config.videos, len(expert))
        self.refreshed_at = -1
        """Agent steps at the last refresh; -1 before the first."""

    def refresh_if_due(
        self,
        agent_steps: int,
        agent_replay: ReplayBuffer,
        reward_model: RewardModel,
        rng: np.random.Generator,
    ) -> Metrics:
        """Trains the inverse dynamics on the agent's steps, then names actions and rewards of the videos.

        Returns:
            Metrics of the last gradient step, or nothing where no refresh was due.
        """
        first = self.refreshed_at < 0
        if not first and agent_steps - self.refreshed_at < self.config.refresh_every:
            return {}
        metrics: Metrics = {}
        for _ in range(self.config.first_updates if first else self.config.updates):
            batch = agent_replay.sample(self.config.batch_size, rng, same_shift=True)
            metrics = self.inverse_dynamics.update(batch)
        for index in range(self.count):
            video = self.expert[index]
            references = draw_references(reward_model, self.expert, rng)
            rewards = reward_model.label(video, references)
            frames = self._at_agent_size(video.frames)
            self.replay.add(Episode(frames, self.inverse_dynamics.actions(frames), video, False), rewards)
        self.refreshed_at = agent_steps
        return metrics

    def mixed(self, agent_replay: ReplayBuffer, batch_size: int, rng: np.random.Generator) -> Batch:
        """A batch of which `share` comes from the expert videos."""
        demonstrated = round(self.config.share * batch_size)
        own = agent_replay.sample(batch_size - demonstrated, rng)
        shown = self.replay.sample(demonstrated, rng)
        joined = {
            name: torch.cat([getattr(own, name), getattr(shown, name)])
            for name in ("observation", "action", "reward", "discount", "next_observation")
        }
        rows = torch.arange(batch_size) >= batch_size - demonstrated
        return replace(Batch(**joined), demonstrated=rows)

    def state(self) -> Arrays:
        """The inverse dynamics, the demonstrations' replay and the time of the last refresh."""
        parts = {"inverse_dynamics": self.inverse_dynamics.state(), "replay": self.replay.state()}
        arrays = {
            f"{part}/{name}": array for part, of_part in parts.items() for name, array in of_part.items()
        }
        return {**arrays, "refreshed_at": np.array([self.refreshed_at], np.int64)}

    def load_state(self, arrays: Arrays) -> None:
        """Restores what `state` returned."""
        for part, component in (("inverse_dynamics", self.inverse_dynamics), ("replay", self.replay)):
            prefix = f"{part}/"
            component.load_state(
                {
                    name.removeprefix(prefix): array
                    for name, array in arrays.items()
                    if name.startswith(prefix)
                }
            )
        self.refreshed_at = int(arrays["refreshed_at"][0])

    def _at_agent_size(self, frames: Frames) -> Frames:
        if frames.shape[1] == self.frame_size:
            return frames
        return np.stack([resize(frame, self.frame_size) for frame in frames])
