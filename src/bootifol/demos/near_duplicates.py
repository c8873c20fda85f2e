"""Videos that show the same though their bytes differ, such as one recording that was compressed twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

SAME_RMS = 2.0
"""Root mean square of the difference, in levels of 255, below which two digests may be one video. A video compressed
again, even badly, stays below 1.6."""

SAME_LARGEST = 16.0
"""No cell of theirs differs by more. Honest videos of one simulator may differ by as little in the mean as compressed
ones, but somewhere they differ much, where something moves: by 19 or more; compressed ones by 13 or less."""

_AXES = 8
"""Principal axes on which candidates are found."""

_SAMPLE = 256
"""Videos that the axes are computed from."""


def near_duplicates(digests: NDArray[np.uint8]) -> list[list[int]]:
    """Groups of videos that show the same.

    Two videos cannot be farther apart on a few axes than they are at all, so a tree over those axes finds the
    candidates, and only they are compared in full: 5000 videos take seconds, not 12 million comparisons.

    Args:
        digests: uint8 `[videos, DIGEST_FRAMES, cells, cells, 3]`.

    Returns:
        Indices, ascending, in groups of at least two; no index is in two groups.
    """
    if len(digests) < 2:
        return []
    sample = _centered(digests[np.linspace(0, len(digests) - 1, min(_SAMPLE, len(digests))).astype(int)])
    axes = np.linalg.svd(sample - sample.mean(0), full_matrices=False)[2][:_AXES]
    places = np.concatenate(
        [_centered(digests[i : i + _SAMPLE]) @ axes.T for i in range(0, len(digests), _SAMPLE)]
    )
    reach = SAME_RMS * float(np.sqrt(sample.shape[1]))
    tree = cKDTree(places)
    groups = []
    grouped = np.zeros(len(digests), bool)
    for index in range(len(digests)):
        if grouped[index]:
            continue
        candidates = [other for other in tree.query_ball_point(places[index], reach) if other > index]
        group = [other for other in sorted(candidates) if not grouped[other] and _same(digests, index, other)]
        if group:
            groups.append([index, *group])
            grouped[groups[-1]] = True
    return groups


def _same(digests: NDArray[np.uint8], left: int, right: int) -> bool:
    difference = _centered(digests[left : left + 1]) - _centered(digests[right : right + 1])
    root_mean_square = float(np.sqrt(np.square(difference).mean()))
    return root_mean_square < SAME_RMS and float(np.abs(difference).max()) < SAME_LARGEST


def _centered(digests: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Digests as rows without the mean of each channel, which compression shifts a little: `[videos, numbers]`."""
    values = digests.astype(np.float32)
    values -= values.mean(axis=(1, 2, 3), keepdims=True)
    return values.reshape(len(values), -1)
