"""GAIfO's reward model: what `training/` sees of the method (arXiv 1807.06158, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch

from bootifol.devices import to_device, to_host
from bootifol.errors import BootifolError
from bootifol.rewards.gaifo import losses
from bootifol.rewards.gaifo.config import GaifoConfig
from bootifol.rewards.gaifo.networks import STACK, Discriminator
from bootifol.rewards.gaifo.stacks import as_pictures, draw_stacks, stack_frames
from bootifol.rewards.learned import LearnedRewardModel
from bootifol.types import FrameBatch, Metrics, Rewards, StepMetrics, Video, VideoSource

LABEL_BATCH = 256
"""Stacks rewarded at once, which bounds the memory that a long video takes."""


class GaifoRewardModel(LearnedRewardModel[GaifoConfig, Discriminator]):
    """A discriminator between the expert's stacks of frames and others.

    Args:
        config: see there.
        video_size: side of the (square) videos in pixels.
        seed: of the parameters and of every draw.
        device: where to compute, as PyTorch names it.
    """

    keeps_learning = True
    reference_count = 0

    def __init__(self, config: GaifoConfig, video_size: int, seed: int, device: str = "cpu") -> None:
        super().__init__(Discriminator, config, video_size, seed, device)

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        """Alignment Phase, which the paper does not have: one gradient step with random videos as the other class."""
        while True:
            yield self._step(expert, other)

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """Interactive Phase: one gradient step with the agent's own videos as the other class."""
        return self._step(expert, agent)

    def label(self, video: Video, references: Sequence[Video] = ()) -> Rewards:
        """`r_{t+1}`, from the logit of the stack that ends at frame t + 1; references are not looked at.

        Raises:
            BootifolError: the video has another size than the model was made for.
        """
        frames = self._checked(video.frames)
        if len(frames) < 2:
            return np.zeros(0, np.float32)
        ends = np.arange(1, len(frames))
        indices = stack_frames(ends, STACK)
        with self._evaluating():
            logits = [
                self._logits(as_pictures(frames[part]))
                for part in np.split(indices, range(LABEL_BATCH, len(indices), LABEL_BATCH))
            ]
            return to_host(losses.reward(torch.cat(logits)))

    def _step(self, expert: VideoSource, other: VideoSource) -> Metrics:
        """Algorithm 1, "update the discriminator": sample as many stacks of either class, go down L_D once."""
        videos = [self._sample(source, self.config.videos_per_class) for source in (expert, other)]
        # Beyond the shorter class's length, how late it is would tell the classes apart.
        length = min(of_class.shape[1] for of_class in videos)
        if length < 2:
            raise BootifolError(
                "the videos have one frame, but the discriminator looks at changes between frames; use longer videos"
            )
        stacks = [
            draw_stacks(of_class[:, :length], self.config.stacks_per_video, STACK, self._rng)
            for of_class in videos
        ]
        step = self._begin_step()
        metrics = step.take(*self._loss(*stacks))
        self.version += 1
        return metrics

    def _loss(self, expert: FrameBatch, other: FrameBatch) -> tuple[torch.Tensor, StepMetrics]:
        """L_D and the metrics on stacks of both classes, uint8 `[N, stack, H, W, 3]` each."""
        pictures = as_pictures(np.concatenate([expert, other]))
        expert_logits, other_logits = self._logits(pictures).chunk(2)
        loss = losses.discriminator_loss(expert_logits, other_logits)
        with torch.no_grad():
            right = torch.cat([expert_logits > 0, other_logits <= 0]).float().mean()
            return loss, {
                "loss/discriminator": loss,
                "discriminator/accuracy": right,
                "discriminator/expert": torch.sigmoid(expert_logits).mean(),
                "discriminator/other": torch.sigmoid(other_logits).mean(),
            }

    def _logits(self, pictures: torch.Tensor) -> torch.Tensor:
        """Float32 logits `[N]` of stacks `[N, 3 * stack, H, W]`."""
        with self._autocast():
            logits: torch.Tensor = self.networks(to_device(pictures, self.device))
            return logits.float()
