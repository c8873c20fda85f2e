"""ViRL's reward model: what `training/` sees of the method (paper, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from bootifol.devices import to_host
from bootifol.rewards.learned import LearnedRewardModel
from bootifol.rewards.video_checks import check_references
from bootifol.rewards.virl import losses
from bootifol.rewards.virl.config import VirlConfig
from bootifol.rewards.virl.networks import VirlNetworks
from bootifol.rewards.virl.sampling import Draw, draw
from bootifol.types import FrameBatch, Frames, Metrics, Rewards, StepMetrics, Video, VideoSource

PAIR = 2
"""Eq. (4) reconstructs the anchor and its positive. Positives come from the same videos as anchors, so every anchor is
reconstructed once and counted twice."""

MARGIN = 1.0
"""rho of both triplet losses."""

NOISE = 0.05
"""Standard deviation of the noise added to a positive copy; pictures lie in [0, 1]."""


class VirlRewardModel(LearnedRewardModel[VirlConfig, VirlNetworks]):
    """A distance between videos, learned by siamese networks while the agent acts.

    Args:
        config: see there.
        video_size: side of the (square) videos in pixels, 64 in the public release.
        seed: of the parameters and of every draw.
        device: where to compute, as PyTorch names it.
    """

    keeps_learning = True

    def __init__(self, config: VirlConfig, video_size: int, seed: int, device: str = "cpu") -> None:
        super().__init__(VirlNetworks, config, video_size, seed, device)
        self.reference_count = config.references

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        """Yields nothing: the distance is learned from the agent's own videos alone."""
        return iter(())

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """One gradient step of L (Eq. 4) on n expert videos and n of the agent."""
        n = self.config.videos_per_class
        expert_videos, agent_videos = self._sample(expert, n), self._sample(agent, n)
        length = min(expert_videos.shape[1], agent_videos.shape[1])
        drawn = draw(self.config, length, self._rng)
        videos = np.concatenate([expert_videos[:, drawn.kept], agent_videos[:, drawn.kept]])
        step = self._begin_step()
        metrics = step.take(*self._losses(videos, drawn))
        self.version += 1
        return metrics

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        """`r_{t+1} = -||h(o_{0:t+1}) - h(o_{e,0:t+1})|| - ||e(o_{t+1}) - e(o_{e,t+1})||`, averaged over references.

        Encodings of the references are kept until the encoders change.
        """
        check_references(video, references, self.reference_count)
        length = len(video.frames)
        frames, sequences = self._encode(video)
        distances = [
            self._distance(frames - expert_frames[:length], sequences - expert_sequences[:length])
            for expert_frames, expert_sequences in self._encoded_once(references, self._encode)
        ]
        return to_host(-torch.stack(distances).mean(0)[1:])

    def _losses(self, videos: FrameBatch, drawn: Draw) -> tuple[torch.Tensor, StepMetrics]:
        """L and its terms on n expert videos followed by n of the agent, uint8 `[2n, T' + 1, H, W, 3]`."""
        config = self.config
        count, length = videos.shape[:2]
        pictures = self._pictures(videos.reshape(-1, *videos.shape[2:]))
        by_video = pictures.view(count, length, *pictures.shape[1:])
        noisy = self._with_noise(by_video[self._on_device(drawn.noisy)])
        with self._autocast():
            frames = self.networks.encode_frames(torch.cat([pictures, noisy.flatten(0, 1)]))
        pool = frames.view(-1, length, frames.shape[1])
        anchor, positive, negative = (
            pool[:count],
            self._reordered(pool, *drawn.positive),
            self._reordered(pool, *drawn.negative),
        )
        sequences = self.networks.encode_sequences(torch.cat([anchor, positive, negative]))
        h_anchor, h_positive, h_negative = (part[:, -1] for part in sequences.chunk(3))

        compared = {
            "sequence_triplet": (h_anchor, h_positive, h_negative),
            "frame_triplet": (anchor, positive, negative),
        }
        terms = {name: losses.siamese_loss(*encodings, MARGIN) for name, encodings in compared.items()}
        decoded = self._on_device(drawn.decoded)
        rows = torch.arange(count, device=self.device)[:, None]
        targets = by_video[rows, decoded].flatten(0, 1)
        if config.sequence_reconstruction_weight > 0:
            unrolled = self.networks.sequence_decoder(h_anchor, length)
            terms["sequence_reconstruction"] = self._reconstruction(targets, unrolled[rows, decoded])
        if config.frame_reconstruction_weight > 0:
            terms["frame_reconstruction"] = self._reconstruction(targets, anchor[rows, decoded])

        total = torch.stack([getattr(config, f"{name}_weight") * term for name, term in terms.items()]).sum()
        with torch.no_grad():
            expert, agent = sequences[:count].chunk(2)
            expert_frames, agent_frames = anchor.chunk(2)
            distances = {
                "expert_agent": self._distance(expert_frames - agent_frames, expert - agent),
                "positive": torch.linalg.vector_norm(h_anchor - h_positive, dim=1),
                "negative": torch.linalg.vector_norm(h_anchor - h_negative, dim=1),
            }
        return total, {
            **{f"loss/{name}": term for name, term in terms.items()},
            **{f"distance/{name}": distance.mean() for name, distance in distances.items()},
        }

    def _reordered(
        self, pool: torch.Tensor, videos: NDArray[np.int64], frames: NDArray[np.int64]
    ) -> torch.Tensor:
        """Encodings of frames `[B, T' + 1]` of the videos `[B]` of a pool `[N, T' + 1, 128]`."""
        return pool[self._on_device(videos)[:, None], self._on_device(frames)]

    def _reconstruction(self, pictures: torch.Tensor, encodings: torch.Tensor) -> torch.Tensor:
        """Of pictures `[N, 3, H, W]` from encodings of frames `[2n, F, 128]`, with N = 2n F."""
        with self._autocast():
            decoded = self.networks.frame_decoder(encodings.flatten(0, 1))
        return PAIR * losses.reconstruction_loss(pictures, decoded)

    def _distance(self, frames: torch.Tensor, sequences: torch.Tensor) -> torch.Tensor:
        """Minus the reward, from the differences of e and of h, each `[..., 128]`."""
        of_frames: torch.Tensor = torch.linalg.vector_norm(frames, dim=-1)
        of_sequences: torch.Tensor = torch.linalg.vector_norm(sequences, dim=-1)
        return of_frames + of_sequences

    def _encode(self, video: Video) -> tuple[torch.Tensor, torch.Tensor]:
        """e and h, each `[T + 1, 128]`, in evaluation mode: a frame's e depends on that frame alone."""
        with self._evaluating():
            with self._autocast():
                encodings = self.networks.encode_frames(self._pictures(self._checked(video.frames)))
            return encodings, self.networks.encode_sequences(encodings[None])[0]

    def _pictures(self, frames: Frames) -> torch.Tensor:
        """uint8 `[N, H, W, 3]` to `[N, 3, H, W]` in [0, 1], channels last in memory."""
        dtype = torch.bfloat16 if self.config.precision == "bf16" else torch.float32
        return self._on_device(frames).permute(0, 3, 1, 2).to(dtype) / 255

    def _with_noise(self, pictures: torch.Tensor) -> torch.Tensor:
        """Videos `[k, T' + 1, 3, H, W]` with Gaussian noise on every number."""
        noise = self._on_device(self._rng.standard_normal(tuple(pictures.shape), dtype=np.float32))
        return pictures + NOISE * noise.to(pictures)
