"""What every reward method implements. `training/` knows this protocol and no method by name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol, runtime_checkable

from torch import Tensor

from bootifol.networks.eyes import Eyes
from bootifol.types import Arrays, Frames, FrameStates, Metrics, Rewards, Video, VideoSource


class RewardModel(Protocol):
    """A reward learned from videos: `align` before the agent acts, `update` while it does, `label` its episodes."""

    reads_environment_reward: bool
    """True only for the upper bound `environment`; otherwise the environment's reward never reaches a learner."""

    keeps_learning: bool
    """True where the method's own paper trains the reward until the run ends; False where it rests after N_train
    agent steps, or never learns while the agent acts."""

    reference_count: int
    """How many expert videos `label` wants to compare an episode with (1 in the paper, 0 for none)."""

    version: int
    """Counts gradient steps; encodings and rewards computed under another version are stale."""

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        """Alignment Phase (Algorithm 1, first loop): yields the metrics of one gradient step each time.

        Endless, or empty for a method that learns only while the agent acts. `loss/total` among the metrics is what
        the step made smaller, and every other `loss/…` a term of it.
        """
        ...

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """Interactive Phase: one gradient step on expert videos and the agent's own.

        No step, and no metrics, for a method that learns only before the agent acts.
        """
        ...

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        """Rewards a whole episode in one causal pass.

        Args:
            video: frames `[T + 1, H, W, 3]`.
            references: `reference_count` expert videos of at least `T + 1` frames; fewer where there are fewer.

        Returns:
            float32 `[T]`; entry `t` depends on frames `0 … t + 1` only.
        """
        ...

    def state(self) -> Arrays:
        """Parameters, optimizer, normalization statistics and random state."""
        ...

    def load_state(self, arrays: Arrays) -> None: ...


class Featurizer(Protocol):
    """A backbone, or a reward model whose eyes rest."""

    @property
    def feature_size(self) -> int:
        """F, features of a frame."""
        ...

    def with_features(self, video: Video) -> Video:
        """The video with the features of its frames."""
        ...


@runtime_checkable
class SeesFrames(Protocol):
    """What a reward model also implements whose eyes rest once the agent acts: frames become states once, and agent,
    inverse dynamics and the reward itself learn from those."""

    video_size: int
    """Side of the frames, in pixels."""

    @property
    def feature_size(self) -> int:
        """Z, numbers in a state."""
        ...

    @property
    def eyes(self) -> Eyes:
        """What makes states of frames; they learn before the agent acts, and never after."""
        ...

    def with_features(self, video: Video) -> Video:
        """The video with the states of its frames."""
        ...

    def states_for_the_agent(self, expert_video: Video) -> FrameStates:
        """States int8 `[T + 1, Z]` of an expert video as the agent's own camera would give them."""
        ...

    def score(self, states: FrameStates) -> Rewards:
        """Rewards float32 `[N]` of frames by their states int8 `[N, Z]`."""
        ...


@runtime_checkable
class EncodesFrames(Protocol):
    """What a reward model also implements where an agent can act on its encodings (`agents/encodings.py`)."""

    encoding_dim: int
    """Z: numbers that stand for a frame."""

    video_size: int
    """Side of the frames it encodes, in pixels."""

    def encode_frames(self, frames: Frames) -> Tensor:
        """Encodings float32 `[N, Z]` of single frames uint8 `[N, S, S, 3]`, each by itself, without gradients."""
        ...
