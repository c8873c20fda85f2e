"""BootIfOL's reward from single frames (beyond the paper): eyes that learn in the Alignment Phase and then rest, and a
head that goes on learning on what they see.

A sequence encoder may read motion, and smoothness tells experts from random videos at once; so it never looks at a
target of two pixels. A single frame has no motion to hide behind.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from bootifol.devices import to_host
from bootifol.errors import BootifolError
from bootifol.networks.eyes import STATE_SIZE, Eyes, as_features, rounding
from bootifol.progress import progress
from bootifol.rewards.bootifol.frames import losses
from bootifol.rewards.bootifol.frames.config import FrameConfig
from bootifol.rewards.bootifol.frames.networks import FrameNetworks
from bootifol.rewards.learned import LearnedRewardModel
from bootifol.types import (
    Arrays,
    FeatureSource,
    Frames,
    FrameStates,
    Metrics,
    OtherCamera,
    Rewards,
    Video,
    VideoSource,
)

NEXT_TO = 2
"""Farthest frame, in agent steps, that counts as next to another, as in L_triplet."""

RANDOM_FRAMES = 4096
"""Frames of random videos that are kept for the Interactive Phase."""

EXPERT_FRAMES = 100_000
"""Most frames of the expert's that are kept so."""

FIRST_FRAMES = 1000
"""Most first frames of either class that say what another camera adds."""

EXCHANGE_ALONE, LATE_FROM_ALONE = 0.5, 0.5
"""Least w_X and c where the eyes learn from the expert's videos alone: exchanged halves and early frames are all that
shows them a failure."""

SHIFT = 2
"""Largest random shift of the pictures, in pixels, while the eyes learn."""


class FrameRewardModel(LearnedRewardModel[FrameConfig, FrameNetworks]):
    """How much a frame looks like the expert's, as a head on what the eyes make of it says.

    Args:
        config: see there.
        video_size: side of the (square) videos in pixels.
        seed: of the parameters and of every draw.
        device: where to compute, as PyTorch names it.
    """

    keeps_learning = False
    reference_count = 0
    feature_size = STATE_SIZE

    def __init__(self, config: FrameConfig, video_size: int, seed: int, device: str = "cpu") -> None:
        super().__init__(FrameNetworks, config, video_size, seed, device)
        self._expert_videos: VideoSource | None = None
        self._other: VideoSource | None = None
        self._offset: NDArray[np.float32] | None = None
        self._random: FrameStates | None = None
        self._expert: FrameStates | None = None

    @property
    def eyes(self) -> Eyes:
        """What makes states of frames; they rest once the agent acts."""
        return self.networks.eyes

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        """Alignment Phase: eyes and head learn from the expert's and random videos.

        L = w_F L_F + w_E L_E + w_T L_T + w_X L_X. Where the other videos are of an `OtherCamera`, the expert's alone
        teach: L_F tells late frames from early ones (c at least 0.5), and L_X, of weight 0.5 or more, makes failures.
        """
        self._expert_videos, self._other = expert, other
        while True:
            yield self._align_step(expert, other)

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """Interactive Phase: one gradient step of the head. L = L_F + w_X L_X + w_B L_B, where L_F tells the expert's
        frames from random ones and L_B bootstraps the head on the agent's.

        Raises:
            BootifolError: the agent's videos have no states.
        """
        if not isinstance(agent, FeatureSource):
            raise BootifolError("the reward from single frames learns from the states of the agent's videos")
        if self._expert is None:
            self._expert = self._as_the_agent_sees(self._some_states(expert, EXPERT_FRAMES))
        random = self._random_states()
        count = self.config.frames_per_class
        of_random = min(round(self.config.random_fraction * count), count - 1) if len(random) else 0
        videos = agent.sample_features(count - of_random, self._rng)
        rows = np.arange(len(videos))
        of_agent = videos[rows, self._rng.integers(videos.shape[1], size=len(videos))]
        of_each = self._frames_of_each(expert, EXPERT_FRAMES)
        of_expert = self._rng.integers(len(self._expert), size=count)
        states = [
            self._expert[of_expert],
            of_agent,
            random[self._rng.integers(max(len(random), 1), size=of_random)],
        ]
        exchange_weight, late_from = self._failures_shown(alone=bool(self._offset_of_looks().any()))
        if exchange_weight > 0:
            moments = self._rng.integers(of_each, size=count)
            states.append(self._expert[of_expert - of_expert % of_each + moments])
        features = as_features(self._on_device(np.concatenate(states)))
        features = features + self.config.noise * self._on_device(
            self._rng.standard_normal(features.shape, dtype=np.float32)
        )
        step = self._begin_step()
        self._optimizer.param_groups[0]["lr"] = self.config.head_learning_rate
        of_class = torch.tensor_split(features, (count, 2 * count - of_random, 2 * count))
        expert_states, agent_states, random_states, another = of_class
        logits = self.networks.logits
        lateness = losses.lateness(self._on_device(of_expert % of_each), of_each, late_from)
        frame = losses.frame_loss(logits(expert_states), logits(random_states), lateness)
        bootstrap = losses.bootstrap_loss(logits(agent_states))
        total = frame + self.config.agent_weight * bootstrap
        terms = {"loss/frame": frame, "loss/bootstrap": bootstrap}
        if exchange_weight > 0:
            same, mixed = losses.exchanged(expert_states, another, random_states)
            terms["loss/exchange"] = losses.exchange_loss(logits(same), lateness, logits(mixed))
            total = total + exchange_weight * terms["loss/exchange"]
        metrics = step.take(total, terms)
        self.version += 1
        return metrics

    def label(self, video: Video, references: Sequence[Video] = ()) -> Rewards:
        """`r_{t+1}` from the logit of frame t + 1; references are not looked at.

        Raises:
            BootifolError: the video has another size than the model was made for.
        """
        return self.score(self.states_of(video)[1:])

    def score(self, states: FrameStates) -> Rewards:
        """Rewards float32 `[N]` of frames by their states int8 `[N, Z]`."""
        with self._evaluating():
            logits = self.networks.logits(as_features(self._on_device(states)))
            return to_host(losses.reward(logits, self.config.floor))

    def states(self, frames: Frames) -> FrameStates:
        """What the eyes make of frames uint8 `[N, S, S, 3]`: int8 `[N, Z]`."""
        return self.eyes.states(self._checked(frames))

    def with_features(self, video: Video) -> Video:
        """The video with the states of its frames."""
        return replace(video, features=self.states_of(video))

    def states_for_the_agent(self, expert_video: Video) -> FrameStates:
        """States int8 `[T + 1, Z]` of an expert video, without what another camera adds to them."""
        return self._as_the_agent_sees(self.states_of(expert_video))

    def states_of(self, video: Video) -> FrameStates:
        """Those that the video has, or computed now; int8 `[T + 1, Z]`."""
        if video.features is not None and video.features.dtype == np.int8:
            return video.features  # type: ignore[return-value]
        return self.states(video.frames)

    def state(self) -> Arrays:
        """What every reward model has, the states of random frames that `update` learns from, and what another camera
        adds to the expert's."""
        random, offset = self._random_states(), self._offset_of_looks()
        return {**super().state(), "random_states": random, "offset_of_looks": offset}

    def load_state(self, arrays: Arrays) -> None:
        """The inverse of `state`."""
        super().load_state(arrays)
        self._random = arrays["random_states"].astype(np.int8)
        # A run of older code has none.
        self._offset = arrays.get("offset_of_looks", np.zeros(STATE_SIZE)).astype(np.float32)
        self._expert = None

    def _random_states(self) -> FrameStates:
        """Of frames of random videos, `[N, Z]`; none where there was no Alignment Phase."""
        if self._random is None:
            nothing = np.zeros((0, STATE_SIZE), np.int8)
            self._random = self._some_states(self._other, RANDOM_FRAMES) if self._other else nothing
        return self._random

    def _some_states(self, videos: VideoSource, most: int) -> FrameStates:
        """States `[N, Z]` of all frames, or of as many of each video, evenly spaced, as give `most`."""
        of_each = self._frames_of_each(videos, most)
        kept = np.random.default_rng(0).permutation(len(videos))[:most]
        states = []
        with progress("what the eyes see of the videos", len(kept)) as advance:
            for index in kept:
                frames = videos[int(index)].frames
                states.append(self.states(frames[np.linspace(0, len(frames) - 1, of_each).astype(int)]))
                advance(1)
        return np.concatenate(states)

    @staticmethod
    def _frames_of_each(videos: VideoSource, most: int) -> int:
        return min(max(most // len(videos), 2), len(videos[0].frames))

    def _align_step(self, expert: VideoSource, other: VideoSource) -> Metrics:
        config = self.config
        alone = isinstance(other, OtherCamera)
        exchange_weight, late_from = self._failures_shown(alone)
        count = config.videos_per_class
        counts = [2 * count, 0] if alone else [count, count]
        videos = [
            self._sample(source, of_class)
            for source, of_class in zip((expert, other), counts, strict=True)
            if of_class
        ]
        length = min(of_class.shape[1] for of_class in videos)
        times = self._draw_times(sum(counts), length)
        frames = np.stack(
            [video[at] for video, at in zip([v for of_class in videos for v in of_class], times, strict=True)]
        )
        shifted = self._shifted(frames.reshape(-1, *frames.shape[2:]))
        step = self._begin_step()
        self._optimizer.param_groups[0]["lr"] = config.learning_rate
        seen = self.networks.eyes(self._on_device(shifted))
        # As coarse as the states that will be kept.
        states = (seen + rounding(seen, self._rng)).unflatten(0, (len(frames), config.moments, 2))
        of_episode, of_time = self.networks.views(states)
        expert_logits, other_logits = torch.split(self.networks.logits(states), counts)
        of_expert = times[: counts[0]].reshape(-1, config.moments, 2)
        lateness = losses.lateness(self._on_device(of_expert), videos[0].shape[1], late_from)
        weights = {
            "frame": config.frame_weight,
            "episode": config.episode_weight,
            "time": config.time_weight,
            "exchange": exchange_weight,
        }
        terms = {"frame": losses.frame_loss(expert_logits, other_logits, lateness)}
        if config.episode_weight > 0:
            moments = of_episode[:, :, 0].transpose(0, 1)
            terms["episode"] = losses.contrast(moments, moments.roll(1, 0), config.temperature)
        if config.time_weight > 0:
            terms["time"] = losses.contrast(of_time[:, :, 0], of_time[:, :, 1], config.temperature)
        if exchange_weight > 0:
            of_expert_videos, of_random_videos = torch.split(states, counts)
            another = of_expert_videos.roll(1, 1)
            same, mixed = losses.exchanged(of_expert_videos, another, of_random_videos)
            logits = self.networks.logits
            terms["exchange"] = losses.exchange_loss(logits(same), lateness, logits(mixed))
        total = torch.stack([weights[name] * term for name, term in terms.items()]).sum()
        metrics = step.take(total, {f"loss/{name}": term for name, term in terms.items()})
        self.version += 1
        self._expert = self._random = self._offset = None
        return metrics

    def _failures_shown(self, alone: bool) -> tuple[float, float]:
        """w_X and c, by whether the eyes learn from the expert's videos alone."""
        weight, late_from = self.config.exchange_weight, self.config.late_from
        if not alone:
            return weight, late_from
        return max(weight, EXCHANGE_ALONE), max(late_from, LATE_FROM_ALONE)

    def _offset_of_looks(self) -> NDArray[np.float32]:
        """`[Z]`: what another camera adds to the states of the expert's frames. 0 where there is none.

        Everybody begins alike, so first frames differ by their looks alone.
        """
        if self._offset is None:
            self._offset = np.zeros(STATE_SIZE, np.float32)
            if isinstance(self._other, OtherCamera) and self._expert_videos is not None:
                of_expert, of_others = (
                    self.states(
                        np.stack([videos[i].frames[0] for i in range(min(len(videos), FIRST_FRAMES))])
                    ).mean(0)
                    for videos in (self._expert_videos, self._other)
                )
                self._offset = (of_expert - of_others).astype(np.float32)
        return self._offset

    def _as_the_agent_sees(self, states: FrameStates) -> FrameStates:
        """States `[N, Z]` of the expert's frames without what another camera adds to them."""
        moved: FrameStates = np.rint(states - self._offset_of_looks()).clip(-127, 127).astype(np.int8)
        return moved

    def _draw_times(self, videos: int, length: int) -> NDArray[np.int64]:
        """Frames `[videos, 2 * moments]` of each video: a moment, a frame next to it, the next moment, and so on."""
        moments = self.config.moments
        if length < moments + NEXT_TO:
            raise BootifolError(
                f"the videos have {length} frames, but {moments + NEXT_TO} are needed to tell {moments} moments apart; "
                "use longer videos, or a lower reward.bootifol.frames.moments"
            )
        times = np.empty((videos, moments, 2), np.int64)
        for of_video in times:
            of_video[:, 0] = self._rng.choice(length - NEXT_TO, moments, replace=False)
        times[..., 1] = times[..., 0] + self._rng.integers(1, NEXT_TO + 1, (videos, moments))
        return times.reshape(videos, -1)

    def _shifted(self, frames: Frames) -> Frames:
        """Frames `[N, S, S, 3]`, each shifted at random by whole pixels, the border replicated."""
        size = frames.shape[1]
        padded = np.pad(frames, ((0, 0), (SHIFT, SHIFT), (SHIFT, SHIFT), (0, 0)), mode="edge")
        corners = self._rng.integers(0, 2 * SHIFT + 1, (len(frames), 2))
        return np.stack(
            [
                picture[row : row + size, column : column + size]
                for picture, (row, column) in zip(padded, corners, strict=True)
            ]
        )
