"""Replay against a list of episodes: what is kept, what is drawn, what survives a file."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from benchmarks.plain.drqv2 import PlainReplay, random_shift
from hypothesis import given, settings
from hypothesis import strategies as st

from bootifol.errors import BootifolError
from bootifol.files import read_arrays, write_arrays
from bootifol.replay.buffer import ReplayBuffer
from bootifol.types import Episode, Video

SIZE = 12  # so that a pixel's place fits in one byte


def labelled_episode(number: int, steps: int, terminated: bool = False) -> tuple[Episode, np.ndarray]:
    """Frames whose channels say (episode, t, place in the picture), actions that say (episode, t)."""
    frames = np.zeros((steps + 1, SIZE, SIZE, 3), dtype=np.uint8)
    frames[..., 0] = number
    frames[..., 1] = np.arange(steps + 1)[:, None, None]
    frames[..., 2] = np.arange(SIZE * SIZE).reshape(SIZE, SIZE)
    actions = np.stack([np.full(steps, number), np.arange(steps)], axis=1).astype(np.float32)
    rewards = np.random.default_rng(number).normal(size=steps).astype(np.float32)
    return Episode(frames, actions, Video(f"episode-{number}", frames), terminated), rewards


def filled(buffer: ReplayBuffer, lengths: list[int]) -> ReplayBuffer:
    for number, steps in enumerate(lengths):
        buffer.add(*labelled_episode(number, steps, terminated=number % 2 == 0))
    return buffer


def shift_of(observation: np.ndarray) -> tuple[int, int]:
    """Where the middle pixel of a `[C, S, S]` observation came from, relative to the middle."""
    place = int(observation[2, SIZE // 2, SIZE // 2])
    return place // SIZE - SIZE // 2, place % SIZE - SIZE // 2


def shifted(observation: np.ndarray, shift: tuple[int, int]) -> np.ndarray:
    padded = np.pad(observation, ((0, 0), (5, 5), (5, 5)), mode="edge")
    y, x = 5 + shift[0], 5 + shift[1]
    return padded[:, y : y + SIZE, x : x + SIZE]


@settings(max_examples=60, deadline=None)
@given(
    episodes=st.lists(st.tuples(st.integers(1, 9), st.booleans()), min_size=1, max_size=12),
    capacity=st.integers(10, 30),
    stack=st.integers(1, 4),
    n_step=st.integers(1, 5),
    shift=st.integers(0, 4),
    seed=st.integers(0, 2**32 - 1),
)
def test_batches_are_those_of_a_list_of_episodes(
    episodes: list[tuple[int, bool]], capacity: int, stack: int, n_step: int, shift: int, seed: int
) -> None:
    buffer = ReplayBuffer(capacity, SIZE, 2, stack, n_step, discount=0.9, shift=shift)
    model = PlainReplay(stack, n_step, discount=0.9)
    kept: list[int] = []
    for number, (steps, terminated) in enumerate(episodes):
        episode, rewards = labelled_episode(number, steps, terminated)
        assert buffer.add(episode, rewards) == number
        model.add(episode, rewards)
        kept.append(number)
        while sum(episodes[k][0] + 1 for k in kept) > capacity:
            kept.pop(0)
        assert list(buffer.episode_ids) == kept
        assert len(buffer) == sum(episodes[k][0] for k in kept)

    batch = buffer.sample(32, np.random.default_rng(seed))
    for b in range(32):
        number, t = (int(value) for value in batch.action[b])
        assert number in kept
        observation, _, reward, discount, next_observation = model.transition(number, t)
        for drawn, expected in (
            (batch.observation[b].numpy(), observation),
            (batch.next_observation[b].numpy(), next_observation),
        ):
            offset = shift_of(drawn)
            assert max(map(abs, offset)) <= shift
            np.testing.assert_array_equal(drawn, shifted(expected, offset))
        assert float(batch.reward[b]) == pytest.approx(reward, abs=1e-6)
        assert float(batch.discount[b]) == pytest.approx(discount)


def test_n_step_return_worked_by_hand() -> None:
    buffer = ReplayBuffer(20, SIZE, 2, n_step=3, discount=0.5)
    episode, _ = labelled_episode(0, 4)
    buffer.add(episode, np.array([1, 2, 4, 8], dtype=np.float32))
    batch = buffer.sample(200, np.random.default_rng(0))
    expected = {  # t: (reward, discount, frame of the next observation); the time limit cut it, so it bootstraps
        0: (1 + 0.5 * 2 + 0.25 * 4, 0.125, 3),
        1: (2 + 0.5 * 4 + 0.25 * 8, 0.125, 4),
        2: (4 + 0.5 * 8, 0.25, 4),
        3: (8, 0.5, 4),
    }
    assert set(batch.action[:, 1].int().tolist()) == set(expected)
    for b in range(200):
        found = (float(batch.reward[b]), float(batch.discount[b]), int(batch.next_observation[b, -2, 0, 0]))
        assert found == expected[int(batch.action[b, 1])]


def test_no_value_after_a_termination() -> None:
    buffer = ReplayBuffer(20, SIZE, 2, n_step=2, discount=0.5)
    buffer.add(*labelled_episode(0, 3, terminated=True))
    batch = buffer.sample(100, np.random.default_rng(0))
    last = batch.action[:, 1] >= 1  # two steps from t = 1 reach the end
    assert torch.equal(batch.discount, torch.where(last, 0.0, 0.25))


def test_every_transition_and_every_shift_is_drawn_equally_often() -> None:
    buffer = filled(ReplayBuffer(28, SIZE, 2, shift=1), [3, 7, 2, 8, 5])  # wraps around, episode 0 dropped
    batch = buffer.sample(22 * 400, np.random.default_rng(0))
    pairs, counts = np.unique(batch.action.numpy(), axis=0, return_counts=True)
    assert len(pairs) == len(buffer) == 22
    assert counts.min() > 300 and counts.max() < 500  # 400 expected, standard deviation 20
    shifts = [shift_of(picture) for picture in batch.observation.numpy()]
    next_shifts = [shift_of(picture) for picture in batch.next_observation.numpy()]
    assert set(shifts) == set(next_shifts) == {(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1)}
    same = np.mean([one == other for one, other in zip(shifts, next_shifts, strict=True)])
    assert same == pytest.approx(1 / 9, abs=0.02)


def test_batch_has_the_promised_memory_format() -> None:
    batch = filled(ReplayBuffer(30, SIZE, 2), [5]).sample(4, np.random.default_rng(0))
    assert batch.observation.shape == batch.next_observation.shape == (4, 9, SIZE, SIZE)
    assert batch.observation.dtype == torch.uint8
    assert batch.observation.is_contiguous(memory_format=torch.channels_last)
    assert batch.action.dtype == batch.reward.dtype == batch.discount.dtype == torch.float32


def test_shift_is_that_of_the_paper() -> None:
    pictures = torch.randint(0, 256, (9, 3, SIZE, SIZE), generator=torch.Generator().manual_seed(0)).float()
    shifts = torch.tensor([(y, x) for y in (-4, 0, 3) for x in (-2, 0, 4)])
    by_grid = random_shift(pictures, shifts, pad=4)
    for picture, shift, expected in zip(pictures.numpy(), shifts.tolist(), by_grid.numpy(), strict=True):
        np.testing.assert_allclose(shifted(picture, (shift[0], shift[1])), expected, atol=0.02)


def test_sampling_depends_on_the_generator_alone() -> None:
    buffer = filled(ReplayBuffer(30, SIZE, 2), [5, 6])
    first, again, other = (buffer.sample(16, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert torch.equal(first.observation, again.observation)
    assert not torch.equal(first.observation, other.observation)


def test_a_batch_is_a_copy() -> None:
    buffer = filled(ReplayBuffer(30, SIZE, 2), [5])
    batch = buffer.sample(8, np.random.default_rng(0))
    kept = batch.action.clone(), batch.observation.clone()
    filled(buffer, [9, 9, 9, 9])
    assert torch.equal(batch.action, kept[0]) and torch.equal(batch.observation, kept[1])


def test_relabel_changes_one_episode_alone() -> None:
    buffer = filled(ReplayBuffer(16, SIZE, 2, n_step=1), [5, 4, 6])  # episode 2 wraps around, 0 is dropped
    assert list(buffer.episode_ids) == [1, 2]
    before = buffer.sample(64, np.random.default_rng(0))
    new = np.arange(6, dtype=np.float32)
    assert buffer.relabel(2, new)
    after = buffer.sample(64, np.random.default_rng(0))
    relabelled = before.action[:, 0] == 2
    assert relabelled.any() and not relabelled.all()
    assert torch.equal(after.reward, torch.where(relabelled, before.action[:, 1], before.reward))


def test_relabel_may_replace_the_actions_too() -> None:
    buffer = filled(ReplayBuffer(60, SIZE, 2, n_step=1, shift=0), [5, 5])
    actions = np.full((5, 2), 9, np.float32)
    buffer.relabel(1, np.zeros(5, np.float32), actions)
    batch = buffer.sample(10, np.random.default_rng(0), transitions=np.arange(10))
    assert (batch.action[:5, 0] == 0).all() and (batch.action[5:] == 9).all()


def test_named_transitions_are_taken_in_their_order() -> None:
    buffer = filled(ReplayBuffer(60, SIZE, 2), [3, 4])
    batch = buffer.sample(4, np.random.default_rng(0), transitions=np.array([6, 0, 2, 3]))
    assert batch.action.tolist() == [[1, 3], [0, 0], [0, 2], [1, 0]]


@pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
def test_history_dropout_repeats_the_newest_frame(fraction: float) -> None:
    buffer = filled(ReplayBuffer(60, SIZE, 2, stack=3, n_step=1, shift=0), [50])
    transitions = np.arange(400) % 40 + 5
    batch = buffer.sample(400, np.random.default_rng(0), transitions=transitions, history_dropout=fraction)
    for observation, newest in ((batch.observation, transitions), (batch.next_observation, transitions + 1)):
        times = observation[:, 1::3, 0, 0].numpy().astype(np.int64)
        repeated = (times == newest[:, None]).all(axis=1)
        whole = (times == newest[:, None] + [-2, -1, 0]).all(axis=1)
        assert (repeated ^ whole).all()
        assert abs(repeated.mean() - fraction) < 0.1


def test_relabel_of_an_overwritten_episode_says_so() -> None:
    buffer = filled(ReplayBuffer(16, SIZE, 2), [5, 4, 6])
    before = {name: array.copy() for name, array in buffer.state().items()}
    assert not buffer.relabel(0, np.zeros(5, dtype=np.float32))
    for name, array in buffer.state().items():
        np.testing.assert_array_equal(array, before[name])


@pytest.mark.parametrize("lengths", [[3], [5, 4], [5, 4, 6, 7, 2]])
def test_state_survives_a_file_exactly(tmp_path, lengths: list[int]) -> None:
    buffer = filled(ReplayBuffer(16, SIZE, 2), lengths)
    write_arrays(tmp_path / "replay.safetensors", buffer.state())
    loaded = ReplayBuffer(16, SIZE, 2)
    loaded.load_state(read_arrays(tmp_path / "replay.safetensors", "the replay"))
    for _ in range(3):
        assert loaded.episode_ids == buffer.episode_ids
        one, other = (b.sample(64, np.random.default_rng(5)) for b in (buffer, loaded))
        for field in ("observation", "action", "reward", "discount", "next_observation"):
            assert torch.equal(getattr(one, field), getattr(other, field))
        ids = [b.add(*labelled_episode(9, 6)) for b in (buffer, loaded)]
        assert ids[0] == ids[1]


def test_only_the_filled_part_is_saved() -> None:
    buffer = filled(ReplayBuffer(1000, SIZE, 2), [5, 4])
    assert buffer.state()["frames"].shape[0] == 11


def test_an_empty_buffer_can_be_saved() -> None:
    loaded = ReplayBuffer(16, SIZE, 2)
    loaded.load_state(ReplayBuffer(16, SIZE, 2).state())
    assert len(loaded) == 0 and loaded.add(*labelled_episode(0, 3)) == 0


@pytest.mark.parametrize("frame_size", [12, 64])
def test_bytes_needed_is_what_a_full_buffer_takes(frame_size: int) -> None:
    buffer = ReplayBuffer(61 * 4, frame_size, 6)
    frames = np.zeros((61, frame_size, frame_size, 3), dtype=np.uint8)
    episode = Episode(frames, np.zeros((60, 6), dtype=np.float32), Video("still", frames), False)
    for _ in range(5):
        buffer.add(episode, np.zeros(60, dtype=np.float32))
    taken = sum(array.nbytes for array in buffer.state().values())
    assert ReplayBuffer.bytes_needed(61 * 4, frame_size, 6) == pytest.approx(taken, rel=0.05)


def test_mistakes_are_sentences() -> None:
    buffer = ReplayBuffer(10, SIZE, 2)
    episode, rewards = labelled_episode(0, 5)
    with pytest.raises(BootifolError, match="replay is empty"):
        buffer.sample(1, np.random.default_rng(0))
    with pytest.raises(BootifolError, match="does not fit in a replay of capacity 10"):
        buffer.add(*labelled_episode(0, 10))
    with pytest.raises(BootifolError, match="picture size"):
        ReplayBuffer(10, SIZE + 1, 2).add(episode, rewards)
    with pytest.raises(BootifolError, match="finite actions"):
        ReplayBuffer(10, SIZE, 3).add(episode, rewards)
    with pytest.raises(BootifolError, match="1 NaN or infinite"):
        buffer.add(episode, np.array([0, 0, np.nan, 0, 0], dtype=np.float32))
    with pytest.raises(BootifolError, match="needs 5 finite rewards"):
        buffer.add(episode, rewards[:4])
    assert len(buffer) == 0 and buffer.add(episode, rewards) == 0
    with pytest.raises(BootifolError, match="NaN"):
        buffer.relabel(0, np.full(5, np.inf, dtype=np.float32))
    with pytest.raises(BootifolError, match="never added"):
        buffer.relabel(1, rewards)
    with pytest.raises(BootifolError, match="does not fit a buffer"):
        ReplayBuffer(10, SIZE + 1, 2).load_state(buffer.state())
    with pytest.raises(BootifolError, match="capacity of at least 2"):
        ReplayBuffer(1, SIZE, 2)
    with pytest.raises(BootifolError, match="GB, which this machine refuses"):
        ReplayBuffer(10**12, SIZE, 2)
