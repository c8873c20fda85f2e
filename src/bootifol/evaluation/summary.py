"""Many numbers in a few, and how sure one can be of their mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from bootifol.errors import BootifolError


@dataclass(frozen=True)
class Summary:
    """Several numbers in a few."""

    count: int
    mean: float
    median: float
    interquartile_mean: float
    """Mean of the middle half: less noisy than the median, less swayed by one lucky episode than the mean."""

    interval: tuple[float, float] | None
    """Bootstrap interval of the mean; None for a single number, which says nothing about spread."""


def summarize(values: ArrayLike, confidence: float = 0.95, resamples: int = 5000, seed: int = 0) -> Summary:
    """Mean, median, interquartile mean and a percentile bootstrap interval of the mean.

    The same values give the same interval: the resampling has its own generator, from `seed`.

    Raises:
        BootifolError: there are no values.
    """
    sample = np.asarray(values, dtype=np.float64).ravel()
    if len(sample) == 0:
        raise BootifolError("there is nothing to summarize: no episode was evaluated; ask for one at least")
    interval = None
    if len(sample) > 1:
        drawn = np.random.default_rng(seed).integers(0, len(sample), size=(resamples, len(sample)))
        tail = (1.0 - confidence) / 2.0
        low, high = np.quantile(sample[drawn].mean(axis=1), [tail, 1.0 - tail])
        interval = (float(low), float(high))
    return Summary(
        count=len(sample),
        mean=float(sample.mean()),
        median=float(np.median(sample)),
        interquartile_mean=float(stats.trim_mean(sample, 0.25)),
        interval=interval,
    )
