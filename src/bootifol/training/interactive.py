"""Interactive Phase: the second loop of Algorithm 1.

The agent acts; its episodes are rewarded by the learned reward and enter replay; and, as the "other" videos that
the reward learns to tell from the expert's, they bootstrap that reward.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import gymnasium
import numpy as np

from bootifol.agents.drqv2 import DrQv2
from bootifol.demos.augmentation import AugmentationConfig, augmented
from bootifol.envs.rollout import Act, EpisodeRecorder, rollout
from bootifol.replay.agent_videos import AgentVideos
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.base import Featurizer, RewardModel, SeesFrames
from bootifol.rewards.references import draw_references
from bootifol.tracking import Averages
from bootifol.training.budget import Budget, Counters, Stopwatch
from bootifol.training.cloning import cloning_due
from bootifol.training.config import InteractiveConfig
from bootifol.training.inferred_demonstrations import Demonstrations
from bootifol.types import Action, Arrays, Batch, Observation, VideoSource


@dataclass
class EpisodeInProgress:
    """What is kept of an episode that was left before its end. Its start and its actions play it again."""

    random_state: dict[str, Any]
    """Of the generator that draws the references, before it drew this episode's."""
    actions: list[Action] = field(default_factory=list)
    """Chosen so far."""
    learned: int = 0
    """Steps that agent and reward have had their updates after."""


@dataclass
class InteractivePhase:
    """Everything the second loop of Algorithm 1 touches."""

    environment: gymnasium.Env[Any, Any]
    expert: VideoSource
    """D_e."""
    agent_videos: AgentVideos
    """D_a."""
    replay: ReplayBuffer
    """D."""
    reward_model: RewardModel
    """f, g, q, d."""
    agent: DrQv2
    """π, Q."""
    demonstrations: Demonstrations | None
    """Expert videos as experience; None, as in the paper, without them."""
    config: InteractiveConfig
    budget: Budget
    counters: Counters
    seed: int
    rng: np.random.Generator
    """Draws reference videos and replay batches."""
    featurizer: Featurizer | None = None
    """Computes the features of every frame once, where the reward model reads features."""
    augmentation: AugmentationConfig | None = None
    """How videos vary in looks when the reward learns from them; None where they do not."""
    stopping: Callable[[], bool] = lambda: False
    """Whether to leave the episode after this step."""

    def __post_init__(self) -> None:
        self.averages = Averages()
        self._watch = Stopwatch()
        self._held_action: Action = np.zeros(self.environment.action_space.shape or (), np.float32)
        self._held_steps = 0
        self._episode: EpisodeInProgress | None = None

    def start_clock(self) -> None:
        """Counts wall-clock time from here on."""
        self._watch = Stopwatch()

    def play_episode(self) -> None:
        """One turn of the outer loop: act and learn for an episode, then reward it and store it.

        Where it is `stopping` or the environment fails, it leaves the episode after what was learned last; the next
        call, maybe of another process, plays it again up to there and goes on as if nothing had been.
        """
        drawing = np.random.default_rng()
        if self._episode is None:
            self._held_steps = 0
            self._episode = EpisodeInProgress(dict(self.rng.bit_generator.state))
            drawing = self.rng
        else:
            drawing.bit_generator.state = self._episode.random_state
        references = draw_references(self.reward_model, self.expert, drawing)
        name = f"agent-{self.counters.episodes:07d}"
        recorder = EpisodeRecorder(name, self.reward_model.reads_environment_reward)
        act, start = self._acts_again(self._episode), episode_seed(self.seed, self.counters.episodes)
        for number, step in enumerate(rollout(self.environment, act, start), start=1):
            recorder.add(step)
            if number <= self._episode.learned:
                continue
            self.counters.agent_steps += 1
            self._update_agent()
            self._update_reward()
            self._episode.learned = number
            if self.stopping():
                self.counters.interactive_seconds += self._watch.lap()
                return
        self._episode = None
        episode = recorder.episode()
        if self.featurizer is not None:
            episode = replace(episode, video=self.featurizer.with_features(episode.video))
        video = episode.video
        rewards = self.reward_model.label(video, references)
        self.replay.add(episode, rewards)
        self.agent_videos.add(video, float(rewards.mean()))
        self.counters.episodes += 1
        self.counters.interactive_seconds += self._watch.lap()
        self.averages.add({"episode/learned_reward": float(rewards.mean())})

    @property
    def steps_in_progress(self) -> int:
        """Agent steps that were learned from in an episode that was left before its end."""
        return 0 if self._episode is None else self._episode.learned

    @property
    def in_progress(self) -> bool:
        """Whether an episode was left before its end."""
        return self._episode is not None

    def state(self) -> Arrays:
        """What goes on with the episode in progress; only where there is one."""
        assert self._episode is not None
        actions = np.array(self._episode.actions, np.float32)
        return {
            "actions": actions.reshape(-1, *self._held_action.shape),
            "learned": np.array([self._episode.learned], np.int64),
            "random": np.frombuffer(json.dumps(self._episode.random_state).encode(), np.uint8),
            "held_action": self._held_action,
            "held_steps": np.array([self._held_steps], np.int64),
        }

    def load_state(self, arrays: Arrays) -> None:
        """Goes on with the episode that `state` was of.

        Raises:
            ValueError: the arrays do not belong to one of this environment's.
        """
        actions, held = arrays["actions"].astype(np.float32), arrays["held_action"].astype(np.float32)
        learned = int(arrays["learned"][0])
        if actions.shape[1:] != self._held_action.shape or held.shape != self._held_action.shape:
            raise ValueError(f"its actions have {list(held.shape)} numbers")
        if not 0 <= learned <= len(actions):
            raise ValueError(f"it counts {learned} of {len(actions)} steps")
        state = json.loads(arrays["random"].astype(np.uint8).tobytes())
        np.random.default_rng().bit_generator.state = state  # refuses what is none
        self._episode = EpisodeInProgress(state, list(actions), learned)
        self._held_action, self._held_steps = held, int(arrays["held_steps"][0])

    @property
    def cloning_due(self) -> bool:
        """Whether a Cloning Phase comes next: with demonstrations, once the warm-up is over and between episodes."""
        if self.demonstrations is None or self._warming_up or self.in_progress:
            return False
        return cloning_due(self.demonstrations, self.counters, self.budget)

    @property
    def _warming_up(self) -> bool:
        return self.counters.agent_steps < self.agent.config.warm_up_steps or len(self.replay) == 0

    def _acts_again(self, episode: EpisodeInProgress) -> Act:
        """Chooses the actions chosen so far once more, and those after them as ever."""
        earlier = iter(list(episode.actions))

        def act(observation: Observation) -> Action:
            action = next(earlier, None)
            if action is None:
                action = self._act(observation)
                episode.actions.append(action)
            return action

        return act

    def _act(self, observation: Observation) -> Action:
        if self._warming_up:
            return self._random_action()
        return self.agent.act(observation, self.budget.scheduled_steps(self.counters), explore=True)

    def _random_action(self) -> Action:
        if self._held_steps == 0:
            self._held_steps = int(self.rng.integers(1, self.agent.config.warm_up_hold + 1))
            self._held_action = self.rng.uniform(-1.0, 1.0, self._held_action.shape).astype(np.float32)
        self._held_steps -= 1
        return self._held_action

    def _update_agent(self) -> None:
        if self._warming_up or self.counters.agent_steps % self.agent.config.update_every:
            return
        if self.demonstrations is not None and not self.counters.cloning_phases:
            return  # the warm-up has ended in this episode, and cloning comes first
        batch = self._batch(self.agent.config.batch_size)
        self.averages.add(self.agent.update(batch, self.budget.scheduled_steps(self.counters)))
        self.counters.agent_updates += 1

    def _batch(self, batch_size: int) -> Batch:
        if self.demonstrations is None:
            return self.replay.sample(batch_size, self.rng)
        return self.demonstrations.mixed(self.replay, batch_size, self.rng)

    def _update_reward(self) -> None:
        if self._warming_up or self.counters.agent_steps % self.config.reward_update_every:
            return
        if self.augmentation is not None and isinstance(self.reward_model, SeesFrames):
            # Videos from files: the head would learn to tell their compression from the agent's clean pictures, and its
            # eyes, which saw them in many looks, rest already.
            return
        resting = self.budget.scheduled_steps(self.counters) > self.config.reward_updates_until
        if resting and not self.reward_model.keeps_learning:
            return
        version = self.reward_model.version
        expert, agent = (augmented(videos, self.augmentation) for videos in (self.expert, self.agent_videos))
        self.averages.add(self.reward_model.update(expert, agent))
        if self.reward_model.version == version:
            return  # nothing was learned, so no stored reward is stale
        self.counters.reward_updates += 1
        if isinstance(self.reward_model, SeesFrames) and self.replay.keeps_states:
            if self.counters.reward_updates % self.config.relabel_every == 0:
                self.replay.relabel_all(self.reward_model.score)
            return
        for _ in range(self.config.relabel_episodes):
            self._relabel_one()

    def _relabel_one(self) -> None:
        """Rewards a stored episode anew, so that replay follows the reward as it learns."""
        ids = self.replay.episode_ids
        kept = range(max(ids.start, ids.stop - len(self.agent_videos)), ids.stop)
        episode_id = int(self.rng.integers(kept.start, kept.stop))
        slot = self.agent_videos.slot_of(age=ids.stop - 1 - episode_id)
        video = self.agent_videos[slot]
        references = draw_references(self.reward_model, self.expert, self.rng)
        # An episode that ended early stands still in the ring up to the full length; no reward looks ahead at that.
        rewards = self.reward_model.label(video, references)[: self.replay.agent_steps_of(episode_id)]
        self.replay.relabel(episode_id, rewards)
        self.agent_videos.reward_anew(slot, float(rewards.mean()))


def episode_seed(run_seed: int, episode: int) -> int:
    """The seed of an episode's start, a function of the run's seed and the episode's number alone, so that a
    resumed run meets the same starts."""
    return int(np.random.SeedSequence([run_seed, 0, episode]).generate_state(1)[0])
