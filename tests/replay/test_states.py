"""Replay of states instead of pictures, against one written plainly."""

from __future__ import annotations

import numpy as np
import pytest

from bootifol.errors import BootifolError
from bootifol.replay.buffer import ReplayBuffer
from bootifol.types import Episode, FrameStates, Rewards, Video

Z, CAPACITY, STACK = 5, 23, 3


def episode(steps: int, rng: np.random.Generator) -> Episode:
    states = rng.integers(-127, 128, (steps + 1, Z)).astype(np.int8)
    nothing = np.zeros((steps + 1, 4, 4, 3), np.uint8)
    actions = rng.uniform(-1, 1, (steps, 2)).astype(np.float32)
    return Episode(nothing, actions, Video("x", nothing, features=states), terminated=False)


def filled(count: int) -> tuple[ReplayBuffer, list[Episode]]:
    rng = np.random.default_rng(0)
    replay = ReplayBuffer(CAPACITY, 4, 2, STACK, n_step=2, discount=0.9, shift=0, feature_size=Z)
    episodes = [episode(int(rng.integers(3, 8)), rng) for _ in range(count)]
    for each in episodes:
        replay.add(each, np.arange(each.agent_steps, dtype=np.float32))
    return replay, episodes[-len(replay.episode_ids) :]


def score(states: FrameStates) -> Rewards:
    return states.astype(np.float32).sum(1)


@pytest.mark.parametrize("count", [2, 9])
def test_every_step_is_rewarded_anew_by_the_frame_after_it(count: int) -> None:
    """Also where the ring wraps around."""
    replay, kept = filled(count)
    replay.relabel_all(score)
    every = replay.sample(len(replay), np.random.default_rng(1), transitions=np.arange(len(replay)))
    t_of = [(each, t) for each in kept for t in range(each.agent_steps)]
    assert len(t_of) == len(replay)
    for row, (each, t) in enumerate(t_of):
        states = each.video.features
        assert states is not None
        rewards = states[1:].astype(np.float64).sum(1)
        steps = min(2, each.agent_steps - t)
        expected = sum(0.9**k * rewards[t + k] for k in range(steps))
        assert float(every.reward[row]) == pytest.approx(expected, rel=1e-5, abs=1e-4)
        stack = np.concatenate([states[max(t - age, 0)] for age in (2, 1, 0)])
        assert np.array_equal(every.observation[row].numpy(), stack)
        later = np.concatenate([states[max(t + steps - age, 0)] for age in (2, 1, 0)])
        assert np.array_equal(every.next_observation[row].numpy(), later)


def test_an_episode_without_states_is_refused() -> None:
    replay, (kept, *_) = filled(2)
    bare = Episode(kept.frames, kept.actions, Video("bare", kept.frames), terminated=False)
    with pytest.raises(BootifolError, match=r"int8 frames \(\d+, 5\), but has none"):
        replay.add(bare, np.zeros(bare.agent_steps, np.float32))


def test_memory_is_that_of_states() -> None:
    assert ReplayBuffer.bytes_needed(1000, 64, 2, feature_size=128) == 1000 * (128 + 8 + 4)
