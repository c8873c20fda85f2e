"""Many numbers in a few, and how sure one can be of their mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from bootifol.errors import BootifolError


@dataclass(frozen=True)
class Summary:
    """Several numbers in a few."""

    count: int
    mean: float
    interquartile_mean: float
    """Mean of the middle half: less noisy than a median, less swayed by one lucky episode than the mean."""

    interval: tuple[float, float] | None
    """Bootstrap interval of the mean; None for a single number, which says nothing about spread."""

    interquartile_interval: tuple[float, float] | None
    """Bootstrap interval of the interquartile mean; None for a single number."""


def summarize(values: ArrayLike, confidence: float = 0.95, resamples: int = 5000, seed: int = 0) -> Summary:
    """Mean, interquartile mean, and percentile bootstrap intervals of both means.

    The same values give the same interval: the resampling has its own generator, from `seed`.

    Raises:
        BootifolError: there are no values.
    """
    sample = np.asarray(values, dtype=np.float64).ravel()
    if len(sample) == 0:
        raise BootifolError("there is nothing to summarize: no episode was evaluated; ask for one at least")
    interval = interquartile_interval = None
    if len(sample) > 1:
        drawn = sample[np.random.default_rng(seed).integers(0, len(sample), size=(resamples, len(sample)))]
        interval = _middle(drawn.mean(axis=1), confidence)
        interquartile_interval = _middle(stats.trim_mean(drawn, 0.25, axis=1), confidence)
    return Summary(
        count=len(sample),
        mean=float(sample.mean()),
        interquartile_mean=float(stats.trim_mean(sample, 0.25)),
        interval=interval,
        interquartile_interval=interquartile_interval,
    )


def _middle(values: NDArray[np.float64], fraction: float) -> tuple[float, float]:
    """The ends of the middle fraction of the values."""
    tail = (1.0 - fraction) / 2.0
    low, high = np.quantile(values, [tail, 1.0 - tail])
    return float(low), float(high)
