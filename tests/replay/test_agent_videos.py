import numpy as np
import pytest
from tests.demos.small_demo_sets import FRAMES, SIZE, moving_videos

from bootifol.errors import BootifolError
from bootifol.files import read_arrays, write_arrays
from bootifol.replay.agent_videos import AgentVideos
from bootifol.types import Video


def filled(capacity: int, count: int) -> AgentVideos:
    ring = AgentVideos(capacity, FRAMES, SIZE)
    for index, frames in enumerate(moving_videos(count)):
        ring.add(Video(f"agent-{index}", frames))
    return ring


@pytest.mark.parametrize("count", [1, 4, 5, 11])
def test_it_keeps_the_newest_episodes(count: int) -> None:
    ring = filled(4, count)
    kept = {ring[i].name: ring[i].frames for i in range(len(ring))}
    assert set(kept) == {f"agent-{index}" for index in range(max(0, count - 4), count)}
    for name, frames in kept.items():
        np.testing.assert_array_equal(frames, moving_videos(count)[int(name.removeprefix("agent-"))])


@pytest.mark.parametrize("count", [0, 2, 4, 7, 9])
def test_the_newest_come_in_order_of_age(count: int) -> None:
    names = [f"agent-{index}" for index in range(count)]
    assert [video.name for video in filled(4, count).newest(3)] == names[-3:]
    assert [video.name for video in filled(4, count).newest(9)] == names[-4:]


@pytest.mark.parametrize("count", [3, 4, 9])
def test_the_slot_of_a_video_is_known_by_its_age(count: int) -> None:
    ring = filled(4, count)
    names = [ring[ring.slot_of(age)].name for age in range(len(ring))]
    assert names == [f"agent-{count - 1 - age}" for age in range(min(count, 4))]
    for age in (-1, len(ring)):
        with pytest.raises(IndexError):
            ring.slot_of(age)


def test_a_short_episode_stands_still_on_its_last_frame() -> None:
    ring = AgentVideos(2, FRAMES, SIZE)
    frames = moving_videos(2)
    ring.add(Video("whole", frames[0]))
    ring.add(Video("short", frames[1][:3]))
    np.testing.assert_array_equal(ring[1].frames[:3], frames[1][:3])
    np.testing.assert_array_equal(ring[1].frames[3:], frames[1][[2, 2]])


def test_a_video_handed_out_does_not_change_when_its_slot_is_overwritten() -> None:
    ring = filled(1, 1)
    video, batch = ring[0], ring.sample(1, np.random.default_rng(0))
    before = video.frames.copy()
    ring.add(Video("next", moving_videos(1, seed=9)[0]))
    np.testing.assert_array_equal(video.frames, before)
    np.testing.assert_array_equal(batch[0], before)


def test_it_draws_only_what_was_added() -> None:
    ring = filled(8, 3)
    added = {frames.tobytes() for frames in moving_videos(3)}
    drawn = [frames.tobytes() for frames in ring.sample(3, np.random.default_rng(0))]
    assert set(drawn) == added
    assert ring.sample(5, np.random.default_rng(0)).shape == (5, FRAMES, SIZE, SIZE, 3)
    with pytest.raises(BootifolError, match="no videos to draw from"):
        AgentVideos(2, FRAMES, SIZE).sample(1, np.random.default_rng(0))


@pytest.mark.parametrize("count", [0, 2, 4, 7])
def test_a_restored_ring_goes_on_bit_for_bit(count: int, tmp_path) -> None:  # type: ignore[no-untyped-def]
    ring, restored = filled(4, count), AgentVideos(4, FRAMES, SIZE)
    write_arrays(tmp_path / "ring.safetensors", ring.state())
    restored.load_state(read_arrays(tmp_path / "ring.safetensors", "the ring"))
    for index, frames in enumerate(moving_videos(3, seed=5)):
        for each in (ring, restored):
            each.add(Video(f"later-{index}", frames))
    assert [ring[i].name for i in range(len(ring))] == [restored[i].name for i in range(len(restored))]
    np.testing.assert_array_equal(
        ring.sample(2, np.random.default_rng(1)), restored.sample(2, np.random.default_rng(1))
    )


def test_wrong_sizes_are_refused() -> None:
    ring = AgentVideos(2, FRAMES, SIZE)
    with pytest.raises(BootifolError, match="the video late is"):
        ring.add(Video("late", np.zeros((FRAMES + 1, SIZE, SIZE, 3), np.uint8)))
    with pytest.raises(BootifolError, match="the video big is"):
        ring.add(Video("big", np.zeros((FRAMES, SIZE + 1, SIZE, 3), np.uint8)))
    with pytest.raises(BootifolError, match="saved agent videos"):
        ring.load_state(filled(4, 4).state())


def test_it_says_its_memory_before_taking_it() -> None:
    assert AgentVideos.bytes_needed(5000, 61, 64) == 5000 * 61 * 64 * 64 * 3


def featured(index: int, frames: int = FRAMES) -> Video:
    features = np.arange(frames * 2, dtype=np.float32).reshape(frames, 2) + 100 * index
    return Video(f"agent-{index}", np.zeros((frames, SIZE, SIZE, 3), np.uint8), features=features)


def test_features_are_kept_in_place_of_pixels(tmp_path) -> None:  # type: ignore[no-untyped-def]
    ring, restored = (AgentVideos(2, FRAMES, SIZE, feature_size=2) for _ in range(2))
    for index in range(3):
        ring.add(featured(index, frames=3 if index == 1 else FRAMES))
    assert [ring[slot].name for slot in range(2)] == ["agent-2", "agent-1"]
    assert ring[0].frames.shape == (FRAMES, 0, 0, 3)
    np.testing.assert_array_equal(ring[0].features, featured(2).features)
    short = featured(1, frames=3).features
    assert short is not None
    np.testing.assert_array_equal(ring[1].features, short[[0, 1, 2, 2, 2]])
    write_arrays(tmp_path / "ring.safetensors", ring.state())
    restored.load_state(read_arrays(tmp_path / "ring.safetensors", "the ring"))
    one, other = (each.sample_features(2, np.random.default_rng(1)) for each in (ring, restored))
    np.testing.assert_array_equal(one, other)
    assert one.shape == (2, FRAMES, 2)
    assert AgentVideos.bytes_needed(1500, 51, 224, 1280) == 1500 * 51 * 1280 * 4


def test_a_ring_of_features_refuses_videos_without_them() -> None:
    ring = AgentVideos(2, FRAMES, SIZE, feature_size=3)
    with pytest.raises(
        BootifolError, match=r"agent-0 has features \[5, 2\] and .* kept as 3 features a frame"
    ):
        ring.add(featured(0))
    with pytest.raises(BootifolError, match="plain has no features"):
        ring.add(Video("plain", moving_videos(1)[0]))
    assert len(ring) == 0
    pixels = AgentVideos(2, FRAMES, SIZE)
    pixels.add(featured(0))
    assert pixels[0].features is None and pixels[0].frames.shape == (FRAMES, SIZE, SIZE, 3)
