"""BootIfOL's reward model: what `training/` sees of the method (paper, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray

from bootifol.devices import to_device, to_host
from bootifol.errors import BootifolError
from bootifol.networks.backbones import load_backbone
from bootifol.networks.color import lab_views
from bootifol.networks.frame_encoders import STATE_SIZE
from bootifol.rewards.bootifol import losses
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.networks import BootifolNetworks
from bootifol.rewards.bootifol.sampling import Draw, draw
from bootifol.rewards.bootifol.scale import DistanceScale
from bootifol.rewards.learned import LearnedRewardModel
from bootifol.rewards.video_checks import check_references
from bootifol.types import (
    Arrays,
    FeatureBatch,
    Features,
    FeatureSource,
    FrameBatch,
    Frames,
    Metrics,
    Rewards,
    Video,
    VideoSource,
)

SCALE_STEPS = 50
"""Gradient steps after which the reward scale rests, if the Alignment Phase had fewer."""


class BootifolRewardModel(LearnedRewardModel[BootifolConfig, BootifolNetworks]):
    """A distance between videos, learned from expert videos and others.

    With a backbone, it learns from features that were computed before: `align` and `update` want a `FeatureSource`.
    `label` computes those of a video that has none.

    Args:
        config: see there.
        video_size: side of the (square) videos in pixels, 64 in the paper.
        seed: of the parameters and of every draw.
        device: where to compute, as PyTorch names it.
    """

    keeps_learning = False
    encoding_dim = STATE_SIZE

    def __init__(self, config: BootifolConfig, video_size: int, seed: int, device: str = "cpu") -> None:
        # Frozen, and therefore no part of the networks that learn and are stored.
        self.backbone = (
            None
            if config.backbone is None
            else load_backbone(config.backbone, video_size, config.precision, device)
        )
        feature_size = self.backbone.feature_size if self.backbone else None
        super().__init__(
            lambda config, size: BootifolNetworks(config, size, feature_size),
            config,
            video_size,
            seed,
            device,
        )
        self.reference_count = config.references
        self._scale = DistanceScale()

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        """Alignment Phase: one gradient step on n expert and n other (random) videos for every item taken."""
        while True:
            yield self._step(expert, other, scaling=True)

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """Interactive Phase: the same gradient step, with the agent's own videos as the other class.

        The reward scale is that of the Alignment Phase; without one, of the first steps here.
        """
        return self._step(expert, agent, scaling=self.version < SCALE_STEPS)

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        """`r_{t+1} = -||f(o_{0:t+1}) - f(o_{e,0:t+1})||` (Algorithm 1), or the cosine of the two.

        Encodings of the references are kept until the encoders change.
        """
        check_references(video, references, self.reference_count)
        length = len(video.frames)
        encoding = self._encode(video)[1:]
        compared = torch.stack([z[1:length] for z in self._encoded_once(references, self._encode)])
        if self.config.reward == "cosine":
            rewards = torch.nn.functional.cosine_similarity(encoding[None], compared, dim=2)
        else:
            rewards = -torch.linalg.vector_norm(encoding[None] - compared, dim=2)
        reward = rewards.mean(0)
        if self.config.reward_scale == "alignment" and self._scale.known:
            reward = self._scale.rewards(reward)
        return to_host(reward)

    def encode_frames(self, frames: Frames) -> torch.Tensor:
        """s = g(o) of single frames: uint8 `[N, H, W, 3]` to float32 `[N, 128]`, without gradients."""
        states = self._frame_states(self._checked(frames))
        return states.clone()  # one that autograd may keep, which a tensor of inference mode is not

    def state(self) -> Arrays:
        """What every reward model has, the reward scale, and the checksum of the backbone's weights."""
        state = {**super().state(), "reward_scale": self._scale.means.copy()}
        if self.backbone:
            state["backbone"] = np.frombuffer(self.backbone.fingerprint.encode(), np.uint8).copy()
        return state

    def load_state(self, arrays: Arrays) -> None:
        """The inverse of `state`.

        Raises:
            BootifolError: as every reward model's; or it was learned from the features of another backbone.
        """
        super().load_state(arrays)
        if self.backbone and arrays["backbone"].tobytes().decode() != self.backbone.fingerprint:
            raise BootifolError(
                f"the reward was learned from features of other weights than those of {self.backbone.name} here; "
                "restore the weights, or start a new run"
            )
        self._scale.means = arrays["reward_scale"].astype(np.float64)

    def _step(self, expert: VideoSource, other: VideoSource, scaling: bool) -> Metrics:
        """Algorithm 1: sample n and n videos, evaluate L, optimize theta, gamma, omega, phi."""
        n = self.config.videos_per_class
        expert_videos, other_videos = self._read(expert, n), self._read(other, n)
        length = min(expert_videos.shape[1], other_videos.shape[1])
        videos = np.concatenate([expert_videos[:, :length], other_videos[:, :length]])
        drawn = draw(self.config, 2 * n, length, self._rng)
        step = self._begin_step()
        total, terms, distances = self._losses(videos[:, drawn.kept], drawn)
        metrics = step.take(total, terms)
        # In float64, of which the scale is made; the host has waited for the step just now.
        measured = to_host(distances).astype(np.float64)
        self.version += 1
        if scaling:
            self._scale.observe(drawn.kept, measured.mean(0))
        return {**metrics, "distance/expert_other": float(measured.mean())}

    def _losses(
        self, videos: FrameBatch | FeatureBatch, drawn: Draw
    ) -> tuple[torch.Tensor, dict[str, torch.Tensor], torch.Tensor]:
        """L and its terms on n expert videos followed by n others, `[2n, T' + 1, H, W, 3]` or `[2n, T' + 1, F]`.

        Returns:
            L; the metrics of its terms; the distance of each expert's and other's encodings at every kept frame,
            `[n, T' + 1]`.
        """
        config = self.config
        count, length = videos.shape[:2]
        inputs = self._inputs(cast(Frames | Features, videos.reshape(-1, *videos.shape[2:])))
        with self._autocast():
            states = self.networks.frame_encoder(*inputs).float()
        within = np.arange(count)[:, None] * length
        anchors = self._indices(within + drawn.anchors)
        anchor_states = states[anchors]
        terms: dict[str, torch.Tensor] = {}

        half = states.shape[1] // 2
        if config.multiview_weight > 0 and not self.backbone:
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
        if config.autoencoder_weight > 0 and self.networks.frame_decoder is not None:
            with self._autocast():
                decoded = self.networks.frame_decoder(anchor_states)
            picture = torch.cat([view[anchors] for view in inputs], dim=1)
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
            distances = torch.linalg.vector_norm(expert - other, dim=2)
        return total, {f"loss/{name}": term for name, term in terms.items()}, distances

    def _encode(self, video: Video) -> torch.Tensor:
        """Encodings z `[T + 1, 128]` of a video, in evaluation mode: a frame's state depends on that frame alone.

        Videos are encoded one by one: the last bits of a matrix product depend on how many rows it has, and a
        resumed run may encode a reference beside another video than the uninterrupted run did.
        """
        states = self._frame_states(self._checked_inputs(video))
        with self._evaluating():
            encodings: torch.Tensor = self.networks.sequence_encoder(states[None])[0][0]
            return encodings

    def _frame_states(self, frames: Frames | Features) -> torch.Tensor:
        """s `[N, 128]` of frames, or of their features, in evaluation mode."""
        inputs = self._inputs(frames)
        with self._evaluating(), self._autocast():
            states: torch.Tensor = self.networks.frame_encoder(*inputs).float()
            return states

    def _read(self, source: VideoSource, count: int) -> FrameBatch | FeatureBatch:
        """Videos drawn at random, as g_theta reads them: `[count, T + 1, H, W, 3]` or features `[count, T + 1, F]`."""
        if not self.backbone:
            return self._sample(source, count)
        features = source.sample_features(count, self._rng) if isinstance(source, FeatureSource) else None
        if features is None or features.shape[2] != self.backbone.feature_size:
            raise BootifolError(
                f"the reward model learns from features of the backbone {self.backbone.name}, and these videos have "
                "none of it: wrap a demo set in bootifol.demos.features.FeaturizedVideos"
            )
        return cast(NDArray[np.float32], features)

    def _checked_inputs(self, video: Video) -> Frames | Features:
        """What g_theta reads of a video, `[T + 1, H, W, 3]` or `[T + 1, F]`."""
        if not self.backbone:
            return self._checked(video.frames)
        features = self.backbone.with_features(video).features
        assert features is not None
        return cast(Features, features)

    def _inputs(self, frames: Frames | Features) -> tuple[torch.Tensor, ...]:
        """Pixels `[N, H, W, 3]` to the views L `[N, 1, H, W]` and ab `[N, 2, H, W]`; features `[N, F]` as they are."""
        if self.backbone:
            return (self._on_device(frames),)
        dtype = torch.bfloat16 if self.config.precision == "bf16" else torch.float32
        lightness, color = lab_views(cast(Frames, frames), dtype)
        return to_device(lightness, self.device), to_device(color, self.device)

    def _indices(self, indices: NDArray[np.int64]) -> torch.Tensor:
        return self._on_device(indices.reshape(-1))
