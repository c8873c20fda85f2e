"""The paper's reward model in ordinary PyTorch, float32: what the speed of the library is measured against.

It shares no code with `bootifol.rewards`. It is what one would write first with care: all frames of all videos in one
batch through the encoders, one LSTM over all videos, losses as matrix products; and no more than that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import cosine_similarity, cross_entropy, normalize

from benchmarks.plain.alignment import (
    LEAK,
    MARGIN,
    PREDICTED,
    TEMPERATURE,
    WINDOW,
    decoder,
    lab,
    view_encoder,
)

DROPPED = 0.05
"""Chance that a frame index is left out, the same in all videos of a batch."""


class Choices(NamedTuple):
    """What one gradient step draws beside its videos; indices are within the kept frames."""

    kept: NDArray[np.int64]
    """`[T']` frame indices."""
    positives: NDArray[np.int64]
    """`[B, T']`: a frame near each frame of each video."""
    negatives: NDArray[np.int64]
    """`[B, T']`: one that is not."""
    start: int
    """L_Z predicts the frames after this one."""


class PlainBootifol:
    """The paper's reward model on 64x64 videos.

    Args:
        divisor: divides the widths of encoders and decoder.
        seed: of the parameters and draws.
    """

    def __init__(self, divisor: int = 1, seed: int = 0) -> None:
        torch.manual_seed(seed)
        self.rng = np.random.default_rng(seed)
        self.encoder_1, self.encoder_2 = view_encoder(1, divisor), view_encoder(2, divisor)
        self.decoder = decoder(divisor)
        self.lstm, self.output = nn.LSTM(128, 128, 2, batch_first=True), nn.Linear(128, 128)
        self.predictor = nn.Sequential(nn.Linear(128, 128), nn.LeakyReLU(LEAK), nn.Linear(128, 128))
        self.networks = nn.ModuleList(
            [self.encoder_1, self.encoder_2, self.decoder, self.lstm, self.output, self.predictor]
        )
        self.optimizer = torch.optim.Adam(self.networks.parameters(), lr=1e-4)

    def encode_frames(self, pictures: Tensor) -> Tensor:
        """Normalized Lab `[N, 3, 64, 64]` to states `[N, 128]`."""
        views = self.encoder_1(pictures[:, :1]), self.encoder_2(pictures[:, 1:])
        return torch.cat(views, dim=1).flatten(1)

    def encode_sequence(self, states: Tensor) -> Tensor:
        """States `[B, T', 128]` to encodings z `[B, T', 128]` of every prefix."""
        encodings: Tensor = self.output(self.lstm(states)[0])
        return encodings

    def draw(self, videos: int, frames: int) -> Choices:
        """The random choices of a gradient step."""
        kept = np.flatnonzero(self.rng.random(frames) >= DROPPED)
        count = len(kept)
        distance = np.abs(np.arange(count)[:, None] - np.arange(count))
        near, far = (distance > 0) & (distance <= WINDOW), distance > WINDOW
        positives, negatives = (
            np.stack([[self.rng.choice(np.flatnonzero(row)) for row in allowed] for _ in range(videos)])
            for allowed in (near, far)
        )
        return Choices(kept, positives, negatives, int(self.rng.integers(5, count - PREDICTED)))

    def loss(self, expert: NDArray[np.uint8], other: NDArray[np.uint8], choices: Choices) -> Tensor:
        """L on n expert and n other videos, uint8 `[n, T + 1, 64, 64, 3]` each."""
        videos = np.concatenate([expert, other])[:, choices.kept]
        count, length = videos.shape[:2]
        pictures = pictures_of(videos.reshape(-1, *videos.shape[2:]))
        every = self.encode_frames(pictures)
        states = every.reshape(count, length, -1)
        reconstruction = ((pictures - self.decoder(every[:, :, None, None])) ** 2).mean()

        alike = normalize(every[:, :64]) @ normalize(every[:, 64:]).T / TEMPERATURE
        itself = torch.arange(len(every))
        multiview = cross_entropy(alike, itself) + cross_entropy(alike.T, itself)

        row = torch.arange(count)[:, None]
        positives, negatives = (torch.from_numpy(each) for each in (choices.positives, choices.negatives))
        near = ((states - states[row, positives]) ** 2).mean(-1)
        far = ((states - states[row, negatives]) ** 2).mean(-1)
        triplet = (near + torch.clamp(MARGIN - far, min=0.0)).mean()

        prefix = states[:, : choices.start + 1]
        for _ in range(PREDICTED):
            following = self.predictor(self.encode_sequence(prefix)[:, -1:])
            prefix = torch.cat([prefix, following], dim=1)
        predicted = normalize(prefix[:, choices.start + 1 :], dim=2)
        matches = (predicted @ normalize(states, dim=2).mT / TEMPERATURE).flatten(0, 1)
        true = torch.arange(choices.start + 1, choices.start + 1 + PREDICTED).repeat(count)
        prediction = cross_entropy(matches, true)

        one, two = self.encode_sequence(states)[:, -1].chunk(2)
        sequence = (contrasted(one, two) + contrasted(two, one)) / 2
        total: Tensor = reconstruction + multiview + triplet + prediction + sequence
        return total

    def alignment_step(self, expert: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
        """One gradient step of the Alignment Phase; returns L."""
        loss = self.loss(expert, other, self.draw(2 * len(expert), expert.shape[1]))
        self.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        return float(loss.detach())

    @torch.no_grad()
    def label(self, video: NDArray[np.uint8], reference: NDArray[np.uint8]) -> Tensor:
        """`r_{t+1} = -||f(o_{0:t+1}) - f(o_{e,0:t+1})||` for every step `[T]`, both videos `[T + 1, 64, 64, 3]`."""
        self.networks.eval()
        states = self.encode_frames(pictures_of(np.concatenate([video, reference])))
        own, expert = self.encode_sequence(states.reshape(2, len(video), -1))
        self.networks.train()
        rewards: Tensor = -torch.linalg.vector_norm(own - expert, dim=1)[1:]
        return rewards


def pictures_of(frames: NDArray[np.uint8]) -> Tensor:
    """Frames `[N, H, W, 3]` as normalized Lab `[N, 3, H, W]`."""
    return torch.from_numpy(np.moveaxis(lab(frames), 0, 1).astype(np.float32))


def contrasted(videos: Tensor, others: Tensor) -> Tensor:
    """L_O in one direction: each of the encodings `[n, 128]` matches the next of its class, against all others."""
    match = cosine_similarity(videos, videos.roll(-1, dims=0))[:, None]
    logits = torch.cat([match, normalize(videos) @ normalize(others).T], dim=1) / TEMPERATURE
    return cross_entropy(logits, torch.zeros(len(videos), dtype=torch.int64))
