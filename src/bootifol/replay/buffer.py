"""Replay: every frame stored once, n-step transitions cut out of whole episodes.

Memory is one ring of `capacity` slots. An episode of `T` agent steps takes `T + 1` consecutive slots (modulo
the capacity), one a frame; the slot of frame `t` also holds action `t` and reward `t`, and the last slot has
a frame only:

    slot      0    1    2    3    4    5    6    7    8    9   10   11
    frame   | g2   g3 | h0   h1   h2   h3 | .    . | f0   f1   f2 | g0 ...
    action  | g2   -  | h0   h1   h2   -  | .    . | f0   f1   -  | g0
    reward  | g2   -  | h0   h1   h2   -  | .    . | f0   f1   -  | g0
                                          ^         ^
                                          head      oldest (f); next g, which wraps around; newest h

Writing at the head drops the oldest episodes whole, so nothing half overwritten is ever read. A transition
is `(episode, t)` with `t < T`; its stack repeats frame 0 where the episode had not begun, its next
observation is that of `min(t + n, T)`. So no batch crosses the border of an episode.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray

from bootifol.errors import BootifolError
from bootifol.replay.crops import crop_stacks
from bootifol.types import Arrays, Batch, Episode, Frames, FrameStates, Rewards

_CHANNELS = 3
_SCORED_AT_ONCE = 8192


@dataclass(frozen=True)
class _Stored:
    """Where an episode lies in the ring."""

    id: int
    start: int
    agent_steps: int
    terminated: bool


class ReplayBuffer:
    """A ring of whole episodes to draw n-step batches from.

    Args:
        capacity: slots of the ring; an episode of `T` transitions takes `T + 1` of them.
        frame_size: height and width of the frames in pixels, `S`.
        action_dim: action dimensions, `A`.
        stack: frames stacked in one observation.
        n_step: rewards summed before bootstrapping.
        discount: per agent step, in [0, 1].
        shift: largest random shift in pixels; 0 turns the augmentation off.
        feature_size: F, where frames are kept as the states of eyes that rest, int8 `[F]`; 0 keeps their pixels.

    Raises:
        BootifolError: a size is out of range or the memory cannot be had.
    """

    def __init__(
        self,
        capacity: int,
        frame_size: int,
        action_dim: int,
        stack: int = 3,
        n_step: int = 3,
        discount: float = 0.99,
        shift: int = 4,
        feature_size: int = 0,
    ) -> None:
        if (
            capacity < 2
            or min(frame_size, action_dim, stack, n_step) < 1
            or shift < 0
            or not 0 <= discount <= 1
        ):
            raise BootifolError(
                "replay needs a capacity of at least 2, positive frame_size, action_dim, stack and n_step, "
                f"shift >= 0 and a discount in [0, 1]; got capacity={capacity}, frame_size={frame_size}, "
                f"action_dim={action_dim}, stack={stack}, n_step={n_step}, shift={shift}, discount={discount}"
            )
        self.capacity = capacity
        self.stack = stack
        self.n_step = n_step
        self.discount = discount
        self.shift = shift
        self.keeps_states = feature_size > 0
        try:
            self._frames: NDArray[np.uint8] | NDArray[np.int8] = (
                np.zeros((capacity, feature_size), dtype=np.int8)
                if self.keeps_states
                else np.zeros((capacity, frame_size, frame_size, _CHANNELS), dtype=np.uint8)
            )
            self._actions = np.zeros((capacity, action_dim), dtype=np.float32)
            self._rewards = np.zeros(capacity, dtype=np.float32)
        except MemoryError:
            needed = self.bytes_needed(capacity, frame_size, action_dim, feature_size)
            raise BootifolError(
                f"replay of {capacity} frames of {frame_size}x{frame_size} needs {needed / 1e9:.1f} GB, which "
                "this machine refuses; choose a smaller replay capacity or smaller frames"
            ) from None
        self._episodes: deque[_Stored] = deque()
        self._head = 0
        self._slots_written = 0
        self._next_id = 0
        self._index()

    @staticmethod
    def bytes_needed(capacity: int, frame_size: int, action_dim: int, feature_size: int = 0) -> int:
        """Bytes of a full buffer, known before it takes them (the system hands them out as episodes arrive)."""
        return capacity * ((feature_size or _CHANNELS * frame_size**2) + 4 * action_dim + 4)

    def __len__(self) -> int:
        """Transitions that can be sampled."""
        return int(self._transition_ends[-1]) if self._episodes else 0

    @property
    def episode_ids(self) -> range:
        """Ids of the episodes whole in the buffer, oldest first."""
        return range(self._next_id - len(self._episodes), self._next_id)

    def add(self, episode: Episode, rewards: Rewards) -> int:
        """Stores an episode, dropping the oldest ones where it needs their slots.

        Args:
            episode: frames uint8 `[T + 1, S, S, 3]`, or states int8 `[T + 1, F]` of its video; actions `[T, A]`.
            rewards: float32 `[T]`.

        Returns:
            The episode's id, one more than that of the episode before.

        Raises:
            BootifolError: sizes that do not fit, more frames than the capacity, or rewards not finite.
        """
        steps = episode.agent_steps
        slots = steps + 1
        frames = episode.video.features if self.keeps_states else episode.frames
        self._check_episode(episode, frames)
        self._check_rewards(rewards, steps, self._next_id)
        used = sum(stored.agent_steps + 1 for stored in self._episodes)
        while used + slots > self.capacity:
            used -= self._episodes.popleft().agent_steps + 1
        where = (self._head + np.arange(slots)) % self.capacity
        self._frames[where] = frames  # type: ignore[assignment]
        self._actions[where[:-1]] = episode.actions
        self._rewards[where[:-1]] = rewards
        self._episodes.append(_Stored(self._next_id, self._head, steps, episode.terminated))
        self._slots_written = min(self.capacity, max(self._slots_written, self._head + slots))
        self._head = (self._head + slots) % self.capacity
        self._next_id += 1
        self._index()
        return self._next_id - 1

    def agent_steps_of(self, episode_id: int) -> int:
        """T of an episode that is whole in the buffer, one of `episode_ids`."""
        return self._episodes[episode_id - self.episode_ids.start].agent_steps

    def relabel(self, episode_id: int, rewards: Rewards, actions: NDArray[np.float32] | None = None) -> bool:
        """Replaces the rewards `[T]` of an episode, and its actions `[T, A]` where there are new ones.

        Returns:
            False, with nothing changed, if the episode was already overwritten.

        Raises:
            BootifolError: the id was never given out, or the rewards do not fit.
        """
        if not 0 <= episode_id < self._next_id:
            raise BootifolError(
                f"episode {episode_id} was never added to replay; relabel ids that add() returned"
            )
        if episode_id not in self.episode_ids:
            return False
        stored = self._episodes[episode_id - self.episode_ids.start]
        self._check_rewards(rewards, stored.agent_steps, episode_id)
        slots = (stored.start + np.arange(stored.agent_steps)) % self.capacity
        self._rewards[slots] = rewards
        if actions is not None:
            self._actions[slots] = actions
        return True

    def relabel_all(self, score: Callable[[FrameStates], Rewards]) -> None:
        """Rewards every step anew by the frame that followed it; for a buffer that keeps states.

        Args:
            score: rewards `[N]` of frames by their states int8 `[N, F]`.
        """
        written = self._slots_written
        chunks = [
            slice(first, min(first + _SCORED_AT_ONCE, written))
            for first in range(0, written, _SCORED_AT_ONCE)
        ]
        scores = np.concatenate([score(cast(FrameStates, self._frames[chunk])) for chunk in chunks])
        # The last slot of an episode has a frame only; what it gets from the next episode's first is never read.
        self._rewards[:written] = np.roll(scores, -1)

    def sample(
        self,
        batch_size: int,
        rng: np.random.Generator,
        same_shift: bool = False,
        transitions: NDArray[np.int64] | None = None,
        history_dropout: float = 0.0,
    ) -> Batch:
        """Draws transitions uniformly, with replacement.

        Args:
            batch_size: how many.
            rng: draws transitions and shifts.
            same_shift: whether the two observations of a transition are shifted alike, for learning what moved
                between them; otherwise each has its own random shift, as in DrQ-v2.
            transitions: numbers `[B]` from 0 to `len(self) - 1`, the oldest first, to take these and draw none.
            history_dropout: fraction of the transitions whose stacks repeat their newest frame, as at a start.

        Raises:
            BootifolError: the buffer is empty.
        """
        if not self._episodes:
            raise BootifolError("replay is empty: add an episode before sampling from it")
        drawn = rng.integers(len(self), size=batch_size) if transitions is None else transitions
        shifts = rng.integers(-self.shift, self.shift + 1, size=(2, batch_size, 2))
        if same_shift:
            shifts[1] = shifts[0]
        has_history = rng.random(batch_size) >= history_dropout if history_dropout > 0 else None

        episode = np.searchsorted(self._transition_ends, drawn, side="right")
        start, steps = self._starts[episode], self._lengths[episode]
        t = drawn - (self._transition_ends[episode] - steps)
        taken = np.minimum(self.n_step, steps - t)
        k = np.arange(self.n_step)
        r_tk = self._rewards[self._slot(start, t + k[:, None])] * (k[:, None] < taken)
        reward = (self.discount**k) @ r_tk.astype(np.float64)
        bootstraps = ~(self._terminated[episode] & (t + taken == steps))

        return Batch(
            observation=self._observations(start, t, shifts[0], has_history),
            action=torch.from_numpy(self._actions[self._slot(start, t)]),
            reward=torch.from_numpy(reward.astype(np.float32)),
            discount=torch.from_numpy((self.discount**taken * bootstraps).astype(np.float32)),
            next_observation=self._observations(start, t + taken, shifts[1], has_history),
        )

    def state(self) -> Arrays:
        """The written part of the buffer.

        The large arrays are views of the buffer's own memory (a copy could double several GB): write them
        to a file, or copy them, before the next `add` or `relabel`.
        """
        written = slice(self._slots_written)
        return {
            "frames": self._frames[written],
            "actions": self._actions[written],
            "rewards": self._rewards[written],
            "episode_starts": self._starts,
            "episode_lengths": self._lengths,
            "episode_terminated": self._terminated.astype(np.uint8),
            "head_and_next_id": np.array([self._head, self._next_id], dtype=np.int64),
        }

    def load_state(self, arrays: Arrays) -> None:
        """Restores what `state` returned, into a buffer built with the same sizes.

        Raises:
            BootifolError: the arrays belong to a buffer of other sizes.
        """
        frames, actions, rewards = arrays["frames"], arrays["actions"], arrays["rewards"]
        written = len(frames)
        if (
            written > self.capacity
            or frames.shape[1:] != self._frames.shape[1:]
            or actions.shape[1:] != self._actions.shape[1:]
        ):
            raise BootifolError(
                f"the saved replay (frames {frames.shape}, actions {actions.shape}) does not fit a buffer of "
                f"frames {self._frames.shape} and actions {self._actions.shape}; use the configuration it was "
                "saved with"
            )
        self._frames[:written] = frames
        self._actions[:written] = actions
        self._rewards[:written] = rewards
        self._slots_written = written
        self._head, self._next_id = (int(value) for value in arrays["head_and_next_id"])
        table = zip(
            arrays["episode_starts"], arrays["episode_lengths"], arrays["episode_terminated"], strict=True
        )
        first_id = self._next_id - len(arrays["episode_starts"])
        self._episodes = deque(
            _Stored(first_id + i, int(start), int(steps), bool(terminated))
            for i, (start, steps, terminated) in enumerate(table)
        )
        self._index()

    def _index(self) -> None:
        """Rebuilds the arrays by which `sample` turns a transition's number into an episode and a step."""
        self._starts = np.array([stored.start for stored in self._episodes], dtype=np.int64)
        self._lengths = np.array([stored.agent_steps for stored in self._episodes], dtype=np.int64)
        self._terminated = np.array([stored.terminated for stored in self._episodes], dtype=bool)
        self._transition_ends = np.cumsum(self._lengths)

    def _slot(self, start: NDArray[np.int64], t: NDArray[np.int64]) -> NDArray[np.int64]:
        slot: NDArray[np.int64] = (start + t) % self.capacity
        return slot

    def _observations(
        self,
        start: NDArray[np.int64],
        t: NDArray[np.int64],
        shifts: NDArray[np.int64],
        has_history: NDArray[np.bool_] | None,
    ) -> torch.Tensor:
        """The stacks ending at frame `t`: shifted pictures uint8 `[B, 3 * stack, S, S]`, channels-last in memory, or
        states int8 `[B, stack * F]`."""
        ages = np.arange(self.stack - 1, -1, -1)
        if has_history is not None:
            ages = ages * has_history[:, None]
        slots = self._slot(start[:, None], np.maximum(t[:, None] - ages, 0))
        if self.keeps_states:
            return torch.from_numpy(self._frames[slots].reshape(len(t), -1))
        size = self._frames.shape[1]
        out = torch.empty((len(t), size, size, _CHANNELS * self.stack), dtype=torch.uint8)
        crop_stacks(cast(Frames, self._frames), slots, shifts, out.numpy())
        return out.permute(0, 3, 1, 2)

    def _check_episode(self, episode: Episode, frames: NDArray[np.generic] | None) -> None:
        steps = episode.agent_steps
        expected, actions = (steps + 1, *self._frames.shape[1:]), (steps, *self._actions.shape[1:])
        dtype = self._frames.dtype
        if steps < 1 or frames is None or frames.shape != expected or frames.dtype != dtype:
            found = "none" if frames is None else f"{frames.dtype} {frames.shape}"
            raise BootifolError(
                f"an episode of {steps} actions for replay must have at least one action and {dtype} frames "
                f"{expected}, but has {found}; check the agent's picture size"
            )
        if episode.actions.shape != actions or not np.isfinite(episode.actions).all():
            raise BootifolError(
                f"an episode for replay must have finite actions {actions}, but has {episode.actions.shape} "
                "or NaN; check the policy that acted"
            )
        if steps + 1 > self.capacity:
            raise BootifolError(
                f"an episode of {steps + 1} frames does not fit in a replay of capacity {self.capacity}; "
                "raise the replay capacity or shorten the episodes"
            )

    @staticmethod
    def _check_rewards(rewards: Rewards, steps: int, episode_id: int) -> None:
        if rewards.shape != (steps,) or not np.isfinite(rewards).all():
            raise BootifolError(
                f"episode {episode_id} needs {steps} finite rewards, but got an array {rewards.shape} with "
                f"{int((~np.isfinite(rewards)).sum())} NaN or infinite ones; check the reward model"
            )
