from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from bootifol.envs.rollout import PlayedEpisode
from bootifol.evaluation import sample_episodes
from bootifol.evaluation.sample_episodes import SampleEpisode, play_sample_episodes, write_sample_episodes
from bootifol.files import read_arrays
from bootifol.types import Episode, FrameBatch, Frames, Rewards, Video


class TwoVideos:
    def __len__(self) -> int:
        return 2

    def __getitem__(self, index: int) -> Video:
        return Video(f"expert-{index}", np.zeros((3, 2, 2, 3), np.uint8))

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        raise NotImplementedError


class NotingReward:
    reads_environment_reward = False
    keeps_learning = False
    reference_count = 1
    version = 0

    def __init__(self) -> None:
        self.seen: list[tuple[str, str]] = []

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        self.seen.append((video.name, references[0].name))
        return np.arange(len(video.frames) - 1, dtype=np.float32)


@pytest.fixture
def fake_play(monkeypatch: pytest.MonkeyPatch) -> None:
    def play(
        environment: object, act: object, seed: int, name: str, keep_environment_rewards: bool
    ) -> PlayedEpisode:
        assert not keep_environment_rewards
        small, large = np.full((3, 2, 2, 3), seed, np.uint8), np.full((3, 4, 4, 3), seed, np.uint8)
        episode = Episode(large, np.zeros((2, 1), np.float32), Video(name, small), terminated=False)
        return PlayedEpisode(episode=episode, environment_return=float(seed), success=None, seed=seed)

    monkeypatch.setattr(sample_episodes, "play_episode", play)


def test_every_actor_plays_every_start_against_the_same_reference(fake_play: None) -> None:
    model = NotingReward()
    acts = {"expert": None, "agent": None, "random": None}
    episodes = play_sample_episodes(None, acts, [5, 6], model, TwoVideos(), np.random.default_rng(0), 40)  # type: ignore[arg-type]
    assert [(e.kind, e.start, e.seed) for e in episodes] == [
        (kind, start, seed) for start, seed in ((0, 5), (1, 6)) for kind in ("expert", "agent", "random")
    ]
    assert len({name for name, _ in model.seen}) == 6
    assert len({reference for _, reference in model.seen[:3]}) == 1
    assert len({reference for _, reference in model.seen[3:]}) == 1
    assert episodes[0].frames.shape == (3, 4, 4, 3)  # the larger picture
    assert episodes[0].rewards.shape == (2,)


def test_arrays_and_videos_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: dict[str, int] = {}

    def fake_write_video(path: Path, frames: Frames, frames_per_second: float) -> None:
        written[str(path.relative_to(tmp_path))] = len(frames)

    monkeypatch.setattr(sample_episodes, "write_video", fake_write_video)
    frames = np.random.default_rng(0).integers(0, 255, (3, 4, 4, 3), dtype=np.uint8)
    write_sample_episodes(tmp_path, [SampleEpisode("agent", 1, 9, frames, np.array([1, 2], np.float32), 0.5)])
    arrays = read_arrays(tmp_path / "showcase.safetensors", "the showcase")
    np.testing.assert_array_equal(arrays["frames/agent/1"], frames)
    np.testing.assert_array_equal(arrays["reward/agent/1"], np.array([1, 2], np.float32))
    assert arrays["environment_return/agent/1"].tolist() == [0.5]
    assert arrays["seed/agent/1"].tolist() == [9]
    assert written == {"videos/agent-1.mp4": 3}
