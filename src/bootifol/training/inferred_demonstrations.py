"""Expert videos as experience: with inferred actions and learned rewards they enter the agent's batches.

This goes beyond the paper, and is off by default. The agent's own steps teach an inverse-dynamics model which action
leads from one picture to the next; it names the actions of the expert videos, the learned reward rewards them, and a
fraction of every batch is drawn from them: the critic learns what the expert's way is worth before the agent has found
it. Where `cloning_updates` is above 0, the policy starts as their clone, too (`cloning.py`). Nobody gave an action or a
reward: both are inferred from pictures.

A clone of stacked pictures learns to go on as it went: what it did last is visible in the stack, and most often what
the expert did next. At rest it then stays at rest. So of most demonstrated stacks only the newest picture is kept, and
most of them are drawn from where the picture moves ("copycat" policies: Wen et al., 2020).
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray

from bootifol.agents.inverse_dynamics import InverseDynamics
from bootifol.envs.pictures import resize
from bootifol.progress import progress
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.base import RewardModel, SeesFrames
from bootifol.rewards.references import draw_references
from bootifol.training.config import DemonstrationConfig
from bootifol.types import Arrays, Batch, Episode, Frames, FrameStates, StepMetrics, Video, VideoSource

MOVING = 0.1
"""A picture moves where it changes by more than this fraction of its video's largest change."""

MOVING_FRACTION = 0.8
"""Fraction of the transitions drawn from expert videos in which the picture moves."""

HISTORY_DROPOUT = 0.8
"""Fraction of the observations drawn from expert videos whose stack repeats its newest frame, where they are cloned."""

BATCH_SIZE = 128
"""Transitions of a gradient step of the inverse dynamics."""

POLICY_FRACTION = 0.5
"""Fraction of these from steps after the warm-up, as soon as there are any: the policy moves more like the expert than
random actions do. The rest comes from all steps."""


class Demonstrations:
    """Expert videos with inferred actions, as a second replay beside the agent's.

    Args:
        config: see there; `fraction` must be above 0.
        expert: D_e.
        replay: empty, and large enough for the videos; filled here, or by `fill` where it keeps states.
        inverse_dynamics: what infers the actions.
        frame_size: size of the agent's pictures.
        featurizer: makes the states of frames, once its eyes rest, where replay keeps them; None otherwise.
    """

    def __init__(
        self,
        config: DemonstrationConfig,
        expert: VideoSource,
        replay: ReplayBuffer,
        inverse_dynamics: InverseDynamics,
        frame_size: int,
        action_dim: int,
        featurizer: SeesFrames | None = None,
    ) -> None:
        self.config = config
        self.expert = expert
        self.replay = replay
        self.inverse_dynamics = inverse_dynamics
        self.frame_size = frame_size
        self.featurizer = featurizer
        self._action_dim = action_dim
        self._states: list[FrameStates] = []
        if featurizer is None:
            self.fill()

    def __len__(self) -> int:
        """Expert videos used."""
        return min(self.config.videos, len(self.expert))

    def fill(self) -> None:
        """Puts the videos into replay, unless they are there; where replay keeps states, the eyes must rest by then."""
        if len(self.replay):
            return
        moving = []
        with progress("expert videos as experience", len(self)) as advance:
            for index in range(len(self)):
                if self.featurizer is not None:
                    self._states.append(self.featurizer.states_for_the_agent(self.expert[index]))
                video = self._video(index)
                frames = self._at_agent_size(video)
                steps = len(frames) - 1
                nothing = np.zeros((steps, self._action_dim), np.float32)
                self.replay.add(Episode(frames, nothing, video, False), np.zeros(steps, np.float32))
                moving.append(moving_steps(frames))
                advance(1)
        self._moving = np.flatnonzero(np.concatenate(moving))
        self._still = np.flatnonzero(~np.concatenate(moving))

    def learn_inverse_dynamics(
        self, agent_replay: ReplayBuffer, policy_steps: int, rng: np.random.Generator, learning_rate: float
    ) -> StepMetrics:
        """One gradient step of the inverse dynamics on the agent's own steps.

        Args:
            agent_replay: all of them.
            policy_steps: how many of them, the newest, came after the warm-up.
            rng: draws the batch.
            learning_rate: of Adam, for this step.
        """
        size, stored = BATCH_SIZE, len(agent_replay)
        newest = min(policy_steps, stored)
        of_policy = round(POLICY_FRACTION * size) if newest > 0 else 0
        drawn = np.concatenate(
            [
                rng.integers(0, stored, size - of_policy),
                stored - 1 - rng.integers(0, max(newest, 1), of_policy),
            ]
        )
        batch = agent_replay.sample(size, rng, same_shift=True, transitions=drawn)
        return self.inverse_dynamics.update(batch, learning_rate)

    def infer(self, index: int, reward_model: RewardModel, rng: np.random.Generator) -> None:
        """Gives a video the actions and rewards that inverse dynamics and reward model now see in it."""
        video = self._video(index)
        rewards = reward_model.label(video, draw_references(reward_model, self.expert, rng))
        frames = self._at_agent_size(video) if self.featurizer is None else cast(FrameStates, video.features)
        actions = self.inverse_dynamics.actions(frames)
        self.replay.relabel(self.replay.episode_ids[index], rewards, actions)

    def relabel_all(self, reward_model: SeesFrames) -> None:
        """Gives all videos the rewards that the reward model now sees in them, where replay keeps states."""
        self.replay.relabel_all(reward_model.score)

    def sample(self, batch_size: int, rng: np.random.Generator) -> Batch:
        """Transitions of the expert videos, most of them where the picture moves."""
        moving = round(batch_size * MOVING_FRACTION)
        moving = batch_size if not len(self._still) else moving if len(self._moving) else 0
        drawn = np.concatenate(
            [rng.choice(self._moving, moving), rng.choice(self._still, batch_size - moving)]
        )
        dropout = HISTORY_DROPOUT if self.config.clones else 0.0
        return self.replay.sample(batch_size, rng, transitions=drawn, history_dropout=dropout)

    def mixed(self, agent_replay: ReplayBuffer, batch_size: int, rng: np.random.Generator) -> Batch:
        """A batch of which `fraction` comes from the expert videos."""
        demonstrated = max(round(self.config.fraction * batch_size), 1)
        own = agent_replay.sample(batch_size - demonstrated, rng)
        shown = self.sample(demonstrated, rng)
        joined = {
            name: torch.cat([getattr(own, name), getattr(shown, name)])
            for name in ("observation", "action", "reward", "discount", "next_observation")
        }
        rows = torch.arange(batch_size) >= batch_size - demonstrated
        return replace(Batch(**joined), demonstrated=rows)

    def state(self) -> Arrays:
        """The inverse dynamics and, once there are any, the inferred actions and rewards."""
        arrays = {f"inverse_dynamics/{name}": array for name, array in self.inverse_dynamics.state().items()}
        if not len(self.replay):
            return arrays
        stored = self.replay.state()
        return {
            **arrays,
            "actions": stored["actions"],
            "rewards": stored["rewards"],
        }

    def load_state(self, arrays: Arrays) -> None:
        """Restores what `state` returned; the pictures are the demo set's, and eyes must have been restored before."""
        prefix = "inverse_dynamics/"
        self.inverse_dynamics.load_state(
            {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
        )
        if "actions" not in arrays:
            return
        self.fill()
        self.replay.load_state(
            {**self.replay.state(), "actions": arrays["actions"], "rewards": arrays["rewards"]}
        )

    def _video(self, index: int) -> Video:
        """With its states, where replay keeps them."""
        video = self.expert[index]
        return video if self.featurizer is None else replace(video, features=self._states[index])

    def _at_agent_size(self, video: Video) -> Frames:
        if video.frames.shape[1] == self.frame_size:
            return video.frames
        return np.stack([resize(frame, self.frame_size) for frame in video.frames])


def moving_steps(frames: Frames) -> NDArray[np.bool_]:
    """Whether the picture moves at each step of a video `[T + 1, S, S, 3]`, bool `[T]`."""
    change = np.abs(np.diff(frames.astype(np.int16), axis=0)).mean(axis=(1, 2, 3))
    moving: NDArray[np.bool_] = change > MOVING * change.max()
    return moving
