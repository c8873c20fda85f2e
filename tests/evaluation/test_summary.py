from collections.abc import Sequence

import numpy as np
import pytest

from bootifol.errors import BootifolError
from bootifol.evaluation.summary import summarize


def test_summary_by_hand() -> None:
    summary = summarize([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 99.0])
    assert summary.count == 8
    assert summary.mean == 15.0
    assert summary.interquartile_mean == 3.5  # of 2, 3, 4, 5


def test_both_intervals_by_hand() -> None:
    sample = np.array([0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0])
    summary = summarize(sample, confidence=0.9, resamples=400, seed=3)
    drawn = [np.sort(sample[row]) for row in np.random.default_rng(3).integers(0, 8, (400, 8))]
    for interval, means in (
        (summary.interval, [row.mean() for row in drawn]),
        (summary.interquartile_interval, [row[2:6].mean() for row in drawn]),
    ):
        assert interval == pytest.approx(tuple(np.quantile(means, [0.05, 0.95])))


def covered(samples: Sequence[np.ndarray], truth: float) -> float:
    intervals = [summarize(sample, resamples=400).interval for sample in samples]
    return float(np.mean([i is not None and i[0] <= truth <= i[1] for i in intervals]))


def test_the_interval_covers_the_true_mean_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    fraction = covered([rng.normal(2.0, 1.0, 30) for _ in range(300)], 2.0)
    assert 0.88 < fraction < 0.98


def test_the_interval_repeats_and_needs_two_values() -> None:
    values = [1.0, 4.0, 2.0]
    assert summarize(values) == summarize(values)
    assert summarize([3.0]).interval is None
    with pytest.raises(BootifolError, match="no episode"):
        summarize([])


def test_one_lucky_episode_widens_the_interval_of_the_mean_only() -> None:
    summary = summarize([0.0] * 15 + [160.0])
    assert summary.interval is not None
    assert summary.interquartile_interval == (0.0, 0.0)
    assert summary.interval[1] > 20.0
    assert summarize([3.0]).interquartile_interval is None
