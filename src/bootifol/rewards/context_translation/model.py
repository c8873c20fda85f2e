"""Context translation's reward model: what `training/` sees of the method."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from bootifol.devices import to_host
from bootifol.rewards.context_translation import losses
from bootifol.rewards.context_translation.config import ContextTranslationConfig
from bootifol.rewards.context_translation.networks import ContextTranslationNetworks
from bootifol.rewards.learned import LearnedRewardModel
from bootifol.rewards.video_checks import check_references
from bootifol.types import Arrays, FrameBatch, Metrics, Rewards, StepMetrics, Video, VideoSource

MEMORY = 0.9
"""The cost of expert frames is averaged exponentially over about the last 10 gradient steps, for it falls quickly."""


class ContextTranslationRewardModel(LearnedRewardModel[ContextTranslationConfig, ContextTranslationNetworks]):
    """Expert videos translated into the agent's context, and the distance of its frames to them.

    Args:
        config: see there.
        video_size: side of the (square) videos in pixels, a multiple of 16.
        seed: of the parameters and of every draw.
        device: where to compute, as PyTorch names it.
    """

    keeps_learning = False

    def __init__(
        self, config: ContextTranslationConfig, video_size: int, seed: int, device: str = "cpu"
    ) -> None:
        super().__init__(ContextTranslationNetworks, config, video_size, seed, device)
        self.reference_count = config.references
        self._expert_cost = 0.0
        """Of an expert frame against one translation; 0 before the first gradient step."""

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        """Alignment Phase: one gradient step on pairs of expert videos for every item taken; `other` is not read."""
        while True:
            yield self._step(expert)

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """Interactive Phase: nothing, as in the paper, which trains its model before the agent acts. No metrics."""
        return {}

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        """Minus `losses.imitation_cost` of frames 1 ... T; the context is the video's own frame 0."""
        check_references(video, references, self.reference_count)
        length = len(video.frames)
        frames = [self._checked(shown.frames[:length]) for shown in references]
        pictures = self._pictures(self._checked(video.frames))
        networks, config = self.networks, self.config
        with self._evaluating(), self._autocast():
            context, skips = networks.context_encoder(pictures[:1])
            context = context.expand(length - 1, -1)
            skips = [skip.expand(length - 1, -1, -1, -1) for skip in skips]
            features = networks.frame_encoder(pictures[1:])[0]
            mean_features = torch.zeros_like(features, dtype=torch.float32)
            # Without their weight, pictures need not be drawn: they then cost nothing beside themselves.
            mean_pictures = torch.zeros_like(pictures[1:]) if config.image_weight > 0 else pictures[1:]
            for shown in frames:
                translated = networks.translator(
                    networks.frame_encoder(self._pictures(shown[1:]))[0], context
                )
                mean_features += translated.float() / len(frames)
                if config.image_weight > 0:
                    mean_pictures += networks.decoder(translated, skips).float() / len(frames)
            cost = losses.imitation_cost(
                features, mean_features, pictures[1:], mean_pictures, config.image_weight
            )
            if config.reward_unit == "expert" and self._expert_cost > 0:
                cost = cost / self._expert_cost
        return to_host(-cost)

    def state(self) -> Arrays:
        """What every reward model has, and the cost of expert frames."""
        return {**super().state(), "expert_cost": np.array([self._expert_cost], dtype=np.float64)}

    def load_state(self, arrays: Arrays) -> None:
        """The inverse of `state`."""
        super().load_state(arrays)
        self._expert_cost = float(arrays["expert_cost"][0])

    def _step(self, expert: VideoSource) -> Metrics:
        """One gradient step on frames of the same moments of two expert videos each."""
        config = self.config
        videos = self._sample(expert, 2 * config.pairs)
        moments = self._rng.integers(videos.shape[1], size=(config.pairs, config.frames_per_pair))
        step = self._begin_step()
        metrics = step.take(*self._losses(videos[: config.pairs], videos[config.pairs :], moments))
        cost = metrics["cost/expert"]
        self._expert_cost = MEMORY * self._expert_cost + (1 - MEMORY) * cost if self.version else cost
        self.version += 1
        return metrics

    def _losses(
        self, source: FrameBatch, target: FrameBatch, moments: NDArray[np.int64]
    ) -> tuple[torch.Tensor, StepMetrics]:
        """L and its terms, from frames of `source` translated into the context of `target`.

        Args:
            source: videos i, uint8 `[n, T + 1, H, W, 3]`.
            target: videos j, of the same shape.
            moments: time steps t, `[n, F]`.

        Returns:
            L, and the metrics.
        """
        networks, config = self.networks, self.config
        rows = np.arange(len(source))[:, None]
        shown = self._pictures(source[rows, moments].reshape(-1, *source.shape[2:]))
        wanted = self._pictures(target[rows, moments].reshape(-1, *target.shape[2:]))
        of_video = torch.arange(len(source), device=self.device).repeat_interleave(moments.shape[1])
        with self._autocast():
            context, skips = networks.context_encoder(self._pictures(target[:, 0]))
            skips = [skip[of_video] for skip in skips]
            shown_features, features = networks.frame_encoder(torch.cat([shown, wanted]))[0].chunk(2)
            translated = networks.translator(shown_features, context[of_video])
            pictures = networks.decoder(translated, skips)
            terms = {"translation": losses.translation_loss(pictures, wanted)}
            terms["alignment"] = losses.alignment_loss(translated, features)
            total = terms["translation"] + config.alignment_weight * terms["alignment"]
            if config.reconstruction_weight > 0:
                decoded = networks.decoder(features, skips)
                terms["reconstruction"] = losses.reconstruction_loss(decoded, wanted)
                total = total + config.reconstruction_weight * terms["reconstruction"]
        with torch.no_grad():
            cost = losses.imitation_cost(features, translated, wanted, pictures, config.image_weight).mean()
        return total, {**{f"loss/{name}": term for name, term in terms.items()}, "cost/expert": cost}

    def _pictures(self, frames: NDArray[np.uint8]) -> torch.Tensor:
        """uint8 `[N, H, W, 3]` to float32 `[N, 3, H, W]` in [-1, 1]."""
        # Channels come last in memory, which the convolutions keep.
        return self._on_device(frames).permute(0, 3, 1, 2).float() / 127.5 - 1
