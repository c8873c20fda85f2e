from collections.abc import Sequence

import numpy as np
import pytest

from bootifol.errors import BootifolError
from bootifol.evaluation.ranking import (
    _PAIRS,
    KINDS,
    _tau_of_pairs,
    area_under_curve,
    expert_above_random,
    margin,
    rank_videos,
    ranking_intervals,
    ranking_scores,
)
from bootifol.evaluation.tables import RankingRow
from bootifol.rewards.references import draw_references
from bootifol.types import FrameBatch, Rewards, Video


class ListedVideos:
    def __init__(self, levels: Sequence[int]) -> None:
        self.videos = [constant_video(f"video-{index}", level) for index, level in enumerate(levels)]

    def __len__(self) -> int:
        return len(self.videos)

    def __getitem__(self, index: int) -> Video:
        return self.videos[index]

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return np.stack([self.videos[i].frames for i in rng.integers(0, len(self), count)])


class BrightnessReward:
    """Rewards each step with minus the distance of the frame's brightness from the references'."""

    reads_environment_reward = False
    keeps_learning = False
    version = 0

    def __init__(self, reference_count: int = 1) -> None:
        self.reference_count = reference_count

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        assert len(references) == self.reference_count
        target = np.mean([reference.frames.mean() for reference in references])
        brightness = video.frames[1:].mean(axis=(1, 2, 3))
        return (-np.abs(brightness - target)).astype(np.float32)


def constant_video(name: str, level: int) -> Video:
    return Video(name, np.full((4, 2, 2, 3), level, np.uint8))


def rows_of(**rewards: list[float]) -> list[RankingRow]:
    return [RankingRow(0, kind, f"{kind}-{i}", r) for kind, rs in rewards.items() for i, r in enumerate(rs)]


def test_scores_of_a_perfect_order() -> None:
    scores = ranking_scores(rows_of(random=[0, 1], half_good=[2, 3], expert=[4, 5], agent=[-100]))
    assert scores.expert_above_half_good == 1.0
    assert scores.half_good_above_random == 1.0
    # 15 pairs, 3 of them within a kind: 12 agree, so tau-b = 12 / sqrt(12 * 15).
    assert scores.kendall_tau == pytest.approx(12 / np.sqrt(12 * 15))
    assert scores.perfect_tau == pytest.approx(scores.kendall_tau)
    # Means differ by 2; each kind has variance 1/2.
    assert scores.expert_margin == pytest.approx(2 / np.sqrt(0.5))


def test_scores_of_a_reversed_and_of_a_constant_reward() -> None:
    reverse = ranking_scores(rows_of(random=[4, 5], half_good=[2, 3], expert=[0, 1]))
    assert reverse.kendall_tau == pytest.approx(-reverse.perfect_tau)
    assert reverse.expert_above_half_good == 0.0
    assert reverse.half_good_margin < 0
    constant = ranking_scores(rows_of(random=[1, 1], half_good=[1, 1], expert=[1, 1]))
    assert (constant.kendall_tau, constant.expert_above_half_good, constant.expert_margin) == (0.0, 0.5, 0.0)
    assert all(np.isfinite(value) for value in constant.metrics().values())


def test_area_under_curve_by_hand() -> None:
    # Pairs (1,0) (1,1) (3,0) (3,1): three wins, one tie.
    assert area_under_curve(np.array([1.0, 3.0]), np.array([0.0, 1.0])) == 3.5 / 4


def test_margin_without_spread_stays_a_number() -> None:
    assert margin(np.array([1.0]), np.array([0.0])) == 1000.0
    assert margin(np.array([0.0, 0.0]), np.array([1.0])) == -1000.0


def test_missing_kinds_and_nan_are_refused() -> None:
    with pytest.raises(BootifolError, match="none of kind half_good"):
        ranking_scores(rows_of(random=[0], expert=[1]))
    with pytest.raises(BootifolError, match="not finite"):
        ranking_scores(rows_of(random=[0], half_good=[1], expert=[float("nan")]))


def test_videos_are_summed_against_drawn_references() -> None:
    videos = {
        "expert": [constant_video("e", 200)],
        "half_good": [constant_video("h", 150)],
        "random": [constant_video("r", 50)],
    }
    rows = rank_videos(BrightnessReward(), videos, ListedVideos([200, 200]), np.random.default_rng(0), 7)
    assert rows == [
        RankingRow(7, "expert", "e", 0.0),
        RankingRow(7, "half_good", "h", -150.0),
        RankingRow(7, "random", "r", -450.0),
    ]
    assert ranking_scores(rows).expert_above_half_good == 1.0


def test_references_differ_and_repeat_with_the_generator() -> None:
    model, expert = BrightnessReward(reference_count=3), ListedVideos(range(5))
    first = [video.name for video in draw_references(model, expert, np.random.default_rng(1))]
    assert len(set(first)) == 3
    assert first == [video.name for video in draw_references(model, expert, np.random.default_rng(1))]
    assert draw_references(BrightnessReward(reference_count=0), expert, np.random.default_rng(1)) == []
    assert len(draw_references(model, ListedVideos([1, 2]), np.random.default_rng(1))) == 2


def test_expert_above_random_counts_pairs_and_needs_no_half_good_video() -> None:
    rows = [
        RankingRow(agent_steps=0, kind=kind, video=f"{kind}-{reward}", reward=reward)
        for kind, reward in (("expert", 3.0), ("expert", 1.0), ("random", 2.0), ("random", 0.0))
    ]
    assert expert_above_random(rows) == 0.75
    with pytest.raises(BootifolError, match="none of kind random"):
        expert_above_random(rows[:2])


def test_intervals_of_a_perfect_order_have_no_width() -> None:
    rows = rows_of(random=[0, 1, 2], half_good=[3, 4, 5], expert=[6, 7, 8])
    intervals = ranking_intervals(rows)
    assert intervals.expert_above_half_good == (1.0, 1.0)
    assert intervals.expert_above_random == (1.0, 1.0)
    perfect = ranking_scores(rows).perfect_tau
    assert intervals.kendall_tau == (pytest.approx(perfect), pytest.approx(perfect))


def test_intervals_hold_the_scores_and_narrow_with_more_videos() -> None:
    rng = np.random.default_rng(0)
    widths = []
    for count in (10, 160):
        drawn = {kind: list(rng.normal(level, 1.0, count)) for level, kind in enumerate(KINDS)}
        rows = rows_of(**drawn)
        scores, intervals = ranking_scores(rows), ranking_intervals(rows, resamples=500)
        for name in ("kendall_tau", "expert_above_half_good", "half_good_above_random"):
            low, high = getattr(intervals, name)
            assert low < getattr(scores, name) < high
        low, high = intervals.kendall_tau
        widths.append(high - low)
        assert intervals == ranking_intervals(rows, resamples=500)
    assert widths[1] == pytest.approx(widths[0] / 4, rel=0.5)


def test_tau_follows_from_the_three_areas_where_no_rewards_are_equal() -> None:
    rng = np.random.default_rng(1)
    rewards = {kind: rng.normal(size=count) for kind, count in zip(KINDS, (5, 7, 9), strict=True)}
    pairs = [area_under_curve(rewards[better], rewards[worse]) for better, worse in _PAIRS]
    scores = ranking_scores(rows_of(**{kind: list(values) for kind, values in rewards.items()}))
    assert _tau_of_pairs(pairs, rewards) == pytest.approx(scores.kendall_tau)


def test_intervals_need_every_kind() -> None:
    with pytest.raises(BootifolError, match="none of kind half_good"):
        ranking_intervals(rows_of(random=[0], expert=[1]))
