"""BootIfOL's reward model: what `training/` sees of the method (paper, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from bootifol.networks.color import lab_views
from bootifol.networks.frame_encoders import STATE_SIZE
from bootifol.rewards.bootifol import losses
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.networks import BootifolNetworks
from bootifol.rewards.bootifol.sampling import Draw, draw
from bootifol.rewards.bootifol.scale import DistanceScale
from bootifol.rewards.bootifol.spoiled import spoiled
from bootifol.rewards.learned import LearnedRewardModel
from bootifol.rewards.video_checks import check_references
from bootifol.types import Arrays, FrameBatch, Frames, Metrics, Rewards, Video, VideoSource


class BootifolRewardModel(LearnedRewardModel[BootifolConfig, BootifolNetworks]):
    """A distance between videos, learned from expert videos and others.

    Args:
        config: see there.
        video_size: side of the (square) videos in pixels, 64 in the paper.
        seed: of the parameters and of every draw.
        device: where to compute, as PyTorch names it.
    """

    keeps_learning = False
    encoding_dim = STATE_SIZE

    def __init__(self, config: BootifolConfig, video_size: int, seed: int, device: str = "cpu") -> None:
        super().__init__(BootifolNetworks, config, video_size, seed, device)
        self.reference_count = config.references
        self._scale = DistanceScale()
        self._encodings: dict[str, torch.Tensor] = {}

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        """Alignment Phase: one gradient step on n expert and n other (random) videos for every item taken."""
        while True:
            yield self._step(expert, other, scaling=True)

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """Interactive Phase: the same gradient step, with the agent's own videos as the other class."""
        return self._step(expert, agent, scaling=not self._scale.known)

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        """`r_{t+1} = -||f(o_{0:t+1}) - f(o_{e,0:t+1})||` (Algorithm 1), or the cosine of the two.

        Encodings of the references are kept until the encoders change.
        """
        check_references(video, references, self.reference_count)
        length = len(video.frames)
        missing = {item.name: item.frames for item in references if item.name not in self._encodings}
        fresh = self._encode([video.frames, *missing.values()])
        self._encodings.update(zip(missing, fresh[1:], strict=True))
        encoding = fresh[0][1:]
        compared = torch.stack([self._encodings[item.name][1:length] for item in references])
        if self.config.reward == "cosine":
            rewards = torch.nn.functional.cosine_similarity(encoding[None], compared, dim=2)
        else:
            rewards = -torch.linalg.vector_norm(encoding[None] - compared, dim=2)
        reward = self._aggregate(rewards)
        if self.config.reward_scale == "alignment" and self._scale.known:
            reward = self._scale.rewards(reward)
        return reward.numpy()

    def embed(self, frames: Frames) -> NDArray[np.float32]:
        """Encodings z of every prefix of a video: `[T + 1, H, W, 3]` to `[T + 1, 128]`."""
        encoding: NDArray[np.float32] = self._encode([frames])[0].numpy()
        return encoding

    def encode_frames(self, frames: Frames) -> torch.Tensor:
        """s = g(o) of single frames: uint8 `[N, H, W, 3]` to float32 `[N, 128]`, without gradients."""
        states = self._frame_states(self._checked(frames))
        return states.clone()  # one that autograd may keep, which a tensor of inference mode is not

    def state(self) -> Arrays:
        """What every reward model has, and the reward scale."""
        return {**super().state(), "reward_scale": self._scale.means.copy()}

    def load_state(self, arrays: Arrays) -> None:
        """The inverse of `state`."""
        super().load_state(arrays)
        self._scale.means = arrays["reward_scale"].astype(np.float64)
        self._encodings.clear()

    def _step(self, expert: VideoSource, other: VideoSource, scaling: bool) -> Metrics:
        """Algorithm 1: sample n and n videos, evaluate L, optimize theta, gamma, omega, phi."""
        n = self.config.videos_per_class
        expert_videos, other_videos = self._sample(expert, n), self._sample(other, n)
        spoiled_count = int(self.config.spoiled_share * n)
        length = min(expert_videos.shape[1], other_videos.shape[1])
        videos = np.concatenate([expert_videos[:, :length], other_videos[:, :length]])
        if spoiled_count:
            shown = self._sample(expert, spoiled_count)
            videos[-spoiled_count:] = spoiled(shown[:, :length], self._rng)
        drawn = draw(self.config, 2 * n, length, self._rng)
        step = self._begin_step()
        total, terms, distances = self._losses(videos[:, drawn.kept], drawn)
        metrics = step.take(total, terms)
        self.version += 1
        self._encodings.clear()
        if scaling:
            self._scale.observe(drawn.kept, distances[: n - spoiled_count].mean(0))
        return metrics

    def _losses(
        self, videos: FrameBatch, drawn: Draw
    ) -> tuple[torch.Tensor, dict[str, float], NDArray[np.float64]]:
        """L and its terms on n expert videos followed by n others, uint8 `[2n, T' + 1, H, W, 3]`.

        Returns:
            L; the metrics; the distance of each expert's and other's encodings at every kept frame, `[n, T' + 1]`.
        """
        config = self.config
        count, length = videos.shape[:2]
        lightness, color = self._views(videos.reshape(-1, *videos.shape[2:]))
        with self._autocast():
            states = self.networks.frame_encoder(lightness, color).float()
        within = np.arange(count)[:, None] * length
        anchors = self._indices(within + drawn.anchors)
        anchor_states = states[anchors]
        terms: dict[str, torch.Tensor] = {}
        weights: dict[str, float] = {}

        half = states.shape[1] // 2
        if config.multiview_weight > 0:
            terms["multiview"] = losses.multiview_loss(
                anchor_states[:, :half], anchor_states[:, half:], config.temperature
            )
        if config.triplet_weight > 0:
            terms["triplet"] = losses.triplet_loss(
                anchor_states,
                states[self._indices(within + drawn.positives)],
                states[self._indices(within + drawn.negatives)],
                config.margin,
            )
        if config.autoencoder_weight > 0:
            with self._autocast():
                decoded = self.networks.frame_decoder(anchor_states)
            picture = torch.cat([lightness[anchors], color[anchors]], dim=1)
            terms["autoencoder"] = losses.autoencoder_loss(picture, decoded)

        sequences = states.unflatten(0, (count, length))
        encodings, predicted = self.networks.encode_and_predict(
            sequences, drawn.start, config.predicted_states
        )
        if config.prediction_weight > 0:
            terms["prediction"] = losses.prediction_loss(
                predicted, sequences, drawn.start, config.temperature
            )
        expert, other = encodings.chunk(2)
        if config.sequence_weight > 0:
            last = expert.shape[1] - 1
            times = [last * (k + 1) // config.sequence_times for k in range(config.sequence_times)]
            at_times = [losses.sequence_loss(expert[:, t], other[:, t], config.temperature) for t in times]
            terms["sequence"] = torch.stack(at_times).mean()

        weights = {name: getattr(config, f"{name}_weight") for name in terms}
        total = torch.stack([weights[name] * term for name, term in terms.items()]).sum()
        with torch.no_grad():
            distances = torch.linalg.vector_norm(expert - other, dim=2).double().cpu().numpy()
        metrics = {f"loss/{name}": float(term.detach()) for name, term in terms.items()}
        metrics["distance/expert_other"] = float(distances.mean())
        return total, metrics, distances

    def _encode(self, videos: Sequence[Frames]) -> list[torch.Tensor]:
        """Encodings `[T + 1, 128]` of each video, in evaluation mode: a frame's state depends on that frame alone."""
        states = self._frame_states(np.concatenate([self._checked(video) for video in videos]))
        with self._evaluating():
            parts = torch.split(states, [len(video) for video in videos])
            return [self.networks.sequence_encoder(part[None])[0][0].cpu() for part in parts]

    def _frame_states(self, frames: Frames) -> torch.Tensor:
        """s `[N, 128]` of frames uint8 `[N, H, W, 3]`, in evaluation mode."""
        with self._evaluating(), self._autocast():
            states: torch.Tensor = self.networks.frame_encoder(*self._views(frames)).float()
            return states

    def _views(self, frames: Frames) -> tuple[torch.Tensor, torch.Tensor]:
        """uint8 `[N, H, W, 3]` to the views L `[N, 1, H, W]` and ab `[N, 2, H, W]`."""
        dtype = torch.bfloat16 if self.config.precision == "bf16" else torch.float32
        lightness, color = lab_views(frames, dtype)
        return lightness.to(self.device), color.to(self.device)

    def _aggregate(self, rewards: torch.Tensor) -> torch.Tensor:
        """Rewards by reference `[R, T]` to `[T]`."""
        if self.config.aggregate == "mean":
            return rewards.mean(0)
        if self.config.aggregate == "min":
            return rewards.amax(0)
        weights = torch.softmax(rewards / self.config.soft_min_temperature, dim=0)
        return (weights * rewards).sum(0)

    def _indices(self, indices: NDArray[np.int64]) -> torch.Tensor:
        return torch.from_numpy(indices.reshape(-1)).to(self.device)
