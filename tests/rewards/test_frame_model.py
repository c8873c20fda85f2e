"""The reward from single frames: it sees what motion hides, and goes on learning without its eyes."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from bootifol.errors import BootifolError
from bootifol.evaluation.ranking import area_under_curve
from bootifol.replay.agent_videos import AgentVideos
from bootifol.rewards.bootifol.frames.config import FrameConfig
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.types import FrameBatch, OtherCamera, Video

SIZE, FRAMES = 32, 12
SMALL = FrameConfig(videos_per_class=8, frames_per_class=32, width=8)


class Reaches:
    """A dot that glides to a target (`to_target`) or, as smoothly, to another place; videos differ in both."""

    def __init__(self, name: str, to_target: bool, count: int = 48, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        self.name = name
        self.videos = np.full((count, FRAMES, SIZE, SIZE, 3), 20, np.uint8)
        for video in self.videos:
            target, start, elsewhere = (rng.integers(2, SIZE - 5, 2) for _ in range(3))
            while np.abs(elsewhere - target).max() < 8:
                elsewhere = rng.integers(2, SIZE - 5, 2)
            goal = target if to_target else elsewhere
            for t, frame in enumerate(video):
                _paint(frame, target, (200, 60, 60), 4)
                fraction = min(t / 6, 1.0)
                _paint(frame, np.round(start + fraction * (goal - start)).astype(int), (240, 230, 150), 3)

    def __len__(self) -> int:
        return len(self.videos)

    def __getitem__(self, index: int) -> Video:
        return Video(f"{self.name}-{index}", self.videos[index])

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return self.videos[rng.choice(len(self.videos), count, replace=count > len(self.videos))]


def _paint(
    frame: NDArray[np.uint8], corner: NDArray[np.int64], color: tuple[int, int, int], side: int
) -> None:
    frame[corner[0] : corner[0] + side, corner[1] : corner[1] + side] = color


EXPERT, OTHER = Reaches("expert", True), Reaches("other", False, seed=4)


def aligned(steps: int, config: FrameConfig = SMALL, seed: int = 1) -> FrameRewardModel:
    model = FrameRewardModel(config, SIZE, seed)
    metrics = model.align(EXPERT, OTHER)
    for _ in range(steps):
        next(metrics)
    return model


@pytest.fixture(scope="module")
def trained() -> FrameRewardModel:
    return aligned(160)


def test_it_sees_a_target_that_no_motion_tells(trained: FrameRewardModel) -> None:
    """Both classes glide alike: what tells them apart is where the dot comes to rest."""
    unseen = [Reaches(f"unseen-{kind}", kind, 32, seed=9) for kind in (True, False)]
    right, wrong = ([float(trained.label(of[i])[-5:].mean()) for i in range(32)] for of in unseen)
    above = np.mean([a > b for a in right for b in wrong])
    assert above > 0.9


def test_a_reward_is_of_its_frame_alone(trained: FrameRewardModel) -> None:
    video = EXPERT[0]
    changed = video.frames.copy()
    changed[5] = 255
    before, after = trained.label(video), trained.label(Video("changed", changed))
    assert before.shape == (FRAMES - 1,) and before.dtype == np.float32
    assert np.flatnonzero(before != after).tolist() == [4]


def test_states_are_enough(trained: FrameRewardModel) -> None:
    video = trained.with_features(EXPERT[1])
    assert video.features is not None and video.features.dtype == np.int8
    without_pixels = Video("states", np.empty((FRAMES, 0, 0, 3), np.uint8), features=video.features)
    assert np.array_equal(trained.label(without_pixels), trained.label(EXPERT[1]))
    scores = trained.score(trained.states(EXPERT[1].frames))[1:]
    assert np.allclose(scores, trained.label(EXPERT[1]), atol=1e-5)


def agents_videos(model: FrameRewardModel, videos: Reaches) -> AgentVideos:
    ring = AgentVideos(len(videos), FRAMES, SIZE, model.feature_size, feature_bytes=1)
    for index in range(len(videos)):
        ring.add(model.with_features(videos[index]))
    return ring


def test_the_agents_failures_lose_and_eyes_rest() -> None:
    model = aligned(100)
    holes = Reaches("hole", False, 16, seed=11)
    ring = agents_videos(model, holes)
    seen = model.states(EXPERT[0].frames)
    before = np.mean([model.label(holes[i]).mean() for i in range(16)])
    config = replace(SMALL, agent_weight=1.0)
    model.config = config
    for _ in range(60):
        metrics = model.update(EXPERT, ring)
    after = np.mean([model.label(holes[i]).mean() for i in range(16)])
    assert after < before - 0.05
    assert np.array_equal(model.states(EXPERT[0].frames), seen), "the eyes do not learn any more"
    assert set(metrics) == {"loss/frame", "loss/bootstrap", "loss/total"}


def test_a_v_that_goes_with_another_u_loses() -> None:
    """What the videos do not show: the dot at rest where another video's target is."""
    model = aligned(60, replace(SMALL, exchange_weight=1.0))
    ring = agents_videos(model, Reaches("hole", False, 16, seed=11))
    for _ in range(100):
        metrics = model.update(EXPERT, ring)
    assert set(metrics) == {"loss/frame", "loss/bootstrap", "loss/exchange", "loss/total"}
    last = np.stack([model.states(EXPERT[i].frames[-1:])[0] for i in range(32)])
    u, v = np.split(last, 2, axis=1)
    right, wrong = model.score(last), model.score(np.concatenate([np.roll(u, 1, 0), v], axis=1))
    assert np.mean(right[:, None] > wrong[None]) > 0.82


def test_the_experts_videos_alone_teach_it() -> None:
    model = FrameRewardModel(SMALL, SIZE, 1)
    losses = list(islice(model.align(EXPERT, OtherCamera(OTHER)), 60))
    assert set(losses[0]) == {"loss/frame", "loss/episode", "loss/time", "loss/exchange", "loss/total"}
    reached, missed = (
        np.concatenate([model.label(videos[index])[7:] for index in range(len(videos))])
        for videos in (EXPERT, OTHER)
    )
    assert area_under_curve(reached, missed) > 0.9


class Filmed(Reaches):
    """The same videos with a bright edge, as another camera shows them."""

    def __init__(self, videos: Reaches) -> None:
        self.name, self.videos = f"{videos.name}-filmed", videos.videos.copy()
        self.videos[:, :, :, :2] += 90


def test_what_another_camera_adds_is_taken_away() -> None:
    model = FrameRewardModel(SMALL, SIZE, 1)
    filmed = Filmed(EXPERT)
    same_starts = Reaches("others", False)
    list(islice(model.align(filmed, OtherCamera(same_starts)), 30))
    clean, shown = (
        np.concatenate([model.states(videos[index].frames) for index in range(len(videos))])
        for videos in (EXPERT, filmed)
    )
    moved = np.concatenate([model.states_for_the_agent(filmed[index]) for index in range(len(filmed))])
    off, left = (np.abs(states.mean(0) - clean.mean(0)).sum() for states in (shown, moved))
    assert left < off / 2
    again = FrameRewardModel(SMALL, SIZE, 1)
    again.load_state(model.state())
    assert np.array_equal(again.states_for_the_agent(filmed[0]), moved[:FRAMES]), "it is part of a checkpoint"


def test_the_experts_alone_go_on_against_the_agent() -> None:
    model = FrameRewardModel(SMALL, SIZE, 1)
    next(model.align(EXPERT, OtherCamera(OTHER)))
    metrics = model.update(EXPERT, agents_videos(model, Reaches("hole", False, 8, seed=11)))
    assert set(metrics) == {"loss/frame", "loss/exchange", "loss/bootstrap", "loss/total"}


@pytest.mark.parametrize("exchange_weight", [0.0, 1.0])
def test_it_goes_on_bit_for_bit_from_what_it_stored(exchange_weight: float) -> None:
    config = replace(SMALL, exchange_weight=exchange_weight)
    whole = aligned(6, config)
    rest = FrameRewardModel(config, SIZE, seed=5)
    rest.load_state({name: array.copy() for name, array in whole.state().items()})
    ring = agents_videos(whole, OTHER)
    for _ in range(3):
        assert whole.update(EXPERT, ring) == rest.update(EXPERT, ring)
    for name, array in whole.state().items():
        assert np.array_equal(array, rest.state()[name]), name


@pytest.mark.parametrize("random_fraction", [0.0, 1.0])
def test_random_frames_are_any_fraction(random_fraction: float) -> None:
    model = aligned(2, replace(SMALL, random_fraction=random_fraction))
    metrics = model.update(EXPERT, agents_videos(model, OTHER))
    assert all(np.isfinite(value) for value in metrics.values())


def test_the_global_random_state_is_left_alone() -> None:
    torch.manual_seed(3)
    expected = torch.randn(2)
    torch.manual_seed(3)
    aligned(1)
    assert torch.equal(torch.randn(2), expected)


def test_videos_too_short_or_without_states_are_refused(trained: FrameRewardModel) -> None:
    class Short(Reaches):
        def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
            return super().sample(count, rng)[:, :4]

    with pytest.raises(BootifolError, match="have 4 frames, but 5 are needed to tell 3 moments apart"):
        next(trained.align(Short("short", True), OTHER))
    with pytest.raises(BootifolError, match="learns from the states of the agent's videos"):
        trained.update(EXPERT, OTHER)
