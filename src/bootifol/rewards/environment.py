"""The upper bound: the environment's own reward, which no method that imitates may read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bootifol.errors import BootifolError
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.types import Arrays, Metrics, Rewards, Video, VideoSource


class EnvironmentRewardModel:
    """Learns nothing and passes on the true reward."""

    reads_environment_reward = True
    keeps_learning = False
    reference_count = 0
    version = 0

    def align(self, expert: VideoSource, other: VideoSource) -> Iterator[Metrics]:
        """There is nothing to align: no items."""
        return iter(())

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """There is nothing to update: no metrics."""
        return {}

    def label(self, video: Video, references: Sequence[Video]) -> Rewards:
        """The true rewards `[T]` of an episode recorded with them.

        Raises:
            BootifolError: the video has none; recordings never do.
        """
        return true_rewards(video)

    def state(self) -> Arrays:
        """Nothing."""
        return {}

    def load_state(self, arrays: Arrays) -> None:
        """Nothing to load."""


class SeeingEnvironmentRewardModel(FrameRewardModel):
    """The same for an agent that reads states: eyes learn from the videos as BootIfOL's do, but the reward is true."""

    reads_environment_reward = True

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        """There is nothing to update: no metrics."""
        return {}

    def label(self, video: Video, references: Sequence[Video] = ()) -> Rewards:
        """As `EnvironmentRewardModel.label`."""
        return true_rewards(video)


def true_rewards(video: Video) -> Rewards:
    """The environment's rewards `[T]` of an episode recorded with them.

    Raises:
        BootifolError: the video has none; recordings never do.
    """
    if video.environment_rewards is None:
        raise BootifolError(
            f"the method environment passes on the environment's reward, but {video.name} has none; "
            "it can only reward the agent's own episodes"
        )
    return video.environment_rewards
