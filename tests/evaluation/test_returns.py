from collections.abc import Sequence

import numpy as np
import pytest

from bootifol.envs.rollout import PlayedEpisode
from bootifol.errors import BootifolError
from bootifol.evaluation import returns
from bootifol.evaluation.returns import EpisodeResult, evaluate, evaluation_rows, scaled_return, summarize
from bootifol.types import Episode, Video


def played(seed: int, name: str) -> PlayedEpisode:
    frames = np.zeros((3, 4, 4, 3), np.uint8)
    episode = Episode(frames, np.zeros((2, 1), np.float32), Video(name, frames), terminated=False)
    return PlayedEpisode(episode=episode, environment_return=float(seed * 10), success=seed > 1, seed=seed)


def test_each_seed_gives_one_result_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    names: list[str] = []

    def fake_play(environment: object, act: object, seed: int, name: str) -> PlayedEpisode:
        names.append(name)
        return played(seed, name)

    monkeypatch.setattr(returns, "play_episode", fake_play)
    results = evaluate(None, None, [3, 1])  # type: ignore[arg-type]
    assert results == [EpisodeResult(3, 30.0, True), EpisodeResult(1, 10.0, False)]
    assert len(set(names)) == 2


def test_scaled_return_is_not_clipped() -> None:
    assert scaled_return(50.0, expert_return=100.0, random_return=0.0) == 0.5
    assert scaled_return(110.0, expert_return=100.0, random_return=10.0) == pytest.approx(100 / 90)
    assert scaled_return(0.0, expert_return=100.0, random_return=10.0) < 0
    with pytest.raises(BootifolError, match="not above the random"):
        scaled_return(1.0, expert_return=5.0, random_return=5.0)


def test_summary_by_hand() -> None:
    summary = summarize([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 99.0])
    assert summary.count == 8
    assert summary.mean == 15.0
    assert summary.median == 3.5
    assert summary.interquartile_mean == 3.5  # of 2, 3, 4, 5


def covered(samples: Sequence[np.ndarray], truth: float) -> float:
    intervals = [summarize(sample, resamples=400).interval for sample in samples]
    return float(np.mean([i is not None and i[0] <= truth <= i[1] for i in intervals]))


def test_the_interval_covers_the_true_mean_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    share = covered([rng.normal(2.0, 1.0, 30) for _ in range(300)], 2.0)
    assert 0.88 < share < 0.98


def test_the_interval_repeats_and_needs_two_values() -> None:
    values = [1.0, 4.0, 2.0]
    assert summarize(values) == summarize(values)
    assert summarize([3.0]).interval is None
    with pytest.raises(BootifolError, match="no episode"):
        summarize([])


def test_rows_hold_scale_and_order() -> None:
    rows = evaluation_rows(
        [EpisodeResult(11, 20.0, None), EpisodeResult(12, 60.0, True)],
        agent_steps=500,
        seconds=1.23456,
        episode_steps=60,
        expert_return=60.0,
        random_return=10.0,
    )
    assert [row.scaled_return for row in rows] == [0.2, 1.0]
    assert [(row.episode, row.seed, row.success) for row in rows] == [(0, 11, None), (1, 12, True)]
    unscaled = evaluation_rows(
        [EpisodeResult(1, 2.0, None)],
        agent_steps=0,
        seconds=0.0,
        episode_steps=60,
        expert_return=None,
        random_return=None,
    )
    assert unscaled[0].scaled_return is None
