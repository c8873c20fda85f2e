"""The scale of the distance reward: what a random video's distance is, at every time step."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

MEMORY = 0.98
"""Distances are averaged exponentially over about the last 50 alignment steps."""


class DistanceScale:
    """Turns distances into rewards `1 - distance / c_t`, with c_t the mean distance of expert and other videos.

    Distances grow as a video goes on, for every video, so the plain reward says above all how late it is. That is
    of no use to an agent, which sees a few frames and not the time. Divided by c_t, a random video gets about 0 at
    every step and a perfect one 1.

    The mean is known for the time steps met so far; later ones take the last of them.
    """

    def __init__(self) -> None:
        self.means: NDArray[np.float64] = np.zeros(0)
        """c_t for frame t, `[frames]`; 0 where no distance was met yet."""

    @property
    def known(self) -> bool:
        """Whether any distance was met."""
        return bool((self.means > 0).any())

    def observe(self, frames: NDArray[np.int64], distances: NDArray[np.float64]) -> None:
        """Takes in the mean distances `[k]` of one gradient step at the frame indices `[k]`."""
        if frames[-1] >= len(self.means):
            self.means = np.pad(self.means, (0, int(frames[-1]) + 1 - len(self.means)))
        before = self.means[frames]
        self.means[frames] = np.where(before > 0, MEMORY * before + (1 - MEMORY) * distances, distances)

    def rewards(self, negative_distances: torch.Tensor) -> torch.Tensor:
        """`1 - distance / c_t` of `-distance` at frames 1 ... T, `[T]`."""
        met = np.flatnonzero(self.means > 0)
        wanted = np.arange(1, len(negative_distances) + 1)
        scale = np.interp(wanted, met, self.means[met])
        return 1 + negative_distances / torch.from_numpy(scale).to(negative_distances)
