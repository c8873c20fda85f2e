"""Interactive Phase: the second loop of Algorithm 1.

The agent acts; its episodes are rewarded by the learned reward and enter replay; and, as the "other" videos that
the reward learns to tell from the expert's, they bootstrap that reward.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import gymnasium
import numpy as np

from bootifol.demos.augmentation import augmented
from bootifol.envs.rollout import EpisodeRecorder, rollout
from bootifol.rewards.base import SeesFrames
from bootifol.rewards.references import draw_references
from bootifol.training.budget import Budget, Counters, PhaseStep, Stopwatch
from bootifol.training.build import Parts
from bootifol.training.cloning import cloning_due
from bootifol.training.config import InteractiveConfig
from bootifol.training.interruption import Interruption
from bootifol.types import Action, Arrays, Batch, Observation, OtherCamera, StepMetrics

RELABEL_EVERY = 100
"""Where replay keeps states: updates of the reward after which every stored step is rewarded anew, which takes a
fraction of a second."""


@dataclass
class EpisodeInProgress:
    """What is kept of an episode that was left before its end. Its start and its actions play it again."""

    random_state: dict[str, Any]
    """Of the generator that draws the references, before it drew this episode's."""
    actions: list[Action] = field(default_factory=list)
    """Chosen so far."""
    learned: int = 0
    """Steps that agent and reward have had their updates after."""


class InteractivePhase:
    """The second loop of Algorithm 1.

    Args:
        parts: all that it touches.
        config: when the reward learns, and when a line is logged.
        budget: how long the phase may last.
        counters: `agent_steps`, `episodes`, updates and `interactive_seconds` are kept up to date.
        seed: of the episodes' starts.
        rng: draws reference videos, replay batches and the warm-up's actions.
        interruption: is looked at after every agent step.
    """

    def __init__(
        self,
        parts: Parts,
        config: InteractiveConfig,
        budget: Budget,
        counters: Counters,
        seed: int,
        rng: np.random.Generator,
        interruption: Interruption,
    ) -> None:
        self.environment: gymnasium.Env[Any, Any] = parts.environment
        self.expert = parts.demos.expert
        self.agent_videos = parts.agent_videos
        self.shown_agent_videos = augmented(parts.agent_videos, parts.demos.augmented)
        """The same as the reward learns from them, in looks that vary like the expert's."""
        self.replay = parts.replay
        self.reward_model = parts.reward_model
        # All videos from files: a head would learn to tell their compression from the agent's clean pictures, and
        # nothing says what it adds to them.
        self.reward_rests = (
            parts.demos.imported
            and not isinstance(parts.demos.random, OtherCamera)
            and isinstance(parts.reward_model, SeesFrames)
        )
        self.featurizer = parts.featurizer
        self.agent = parts.agent
        self.demonstrations = parts.demonstrations
        self.config = config
        self.budget, self.counters = budget, counters
        self.seed, self.rng = seed, rng
        self.interruption = interruption
        self._watch = Stopwatch()
        self._held_action: Action = np.zeros(parts.environment.action_space.shape or (), np.float32)
        self._held_steps = 0
        self._episode: EpisodeInProgress | None = None

    def steps(self) -> Iterator[PhaseStep]:
        """Plays episodes until the run's end, or until a Cloning Phase is due.

        Yields:
            Each whole episode.

        Raises:
            Stopped: the run was asked to stop; the episode is left where it is.
        """
        self._watch = Stopwatch()
        while self.in_progress or not (self.budget.ended(self.counters) or self.cloning_due):
            logged = (self.counters.agent_steps - self.steps_in_progress) // self.config.log_every
            metrics = self.play_episode()
            _, done, _ = self.budget.interactive_extent(self.counters)
            log_is_due = self.counters.agent_steps // self.config.log_every > logged
            yield PhaseStep(self.counters.agent_steps, done, metrics, log_is_due)

    def play_episode(self) -> list[StepMetrics]:
        """One turn of the outer loop: act and learn for an episode, then reward it and store it.

        Where the run is stopped or the environment fails, the episode is left after what was learned last; the next
        call, maybe of another process, plays it again up to there and goes on as if nothing had been.

        Returns:
            The metrics of each update, and of the episode.

        Raises:
            Stopped: the run was asked to stop.
        """
        counters, metrics = self.counters, list[StepMetrics]()
        # O_e <- sample(D_e): as the generator stood when the episode began, also where it is played again.
        drawing = self.rng
        if self._episode is None:
            self._held_steps = 0
            self._episode = EpisodeInProgress(dict(self.rng.bit_generator.state))
        else:
            drawing = np.random.default_rng()
            drawing.bit_generator.state = self._episode.random_state
        references = draw_references(self.reward_model, self.expert, drawing)

        # o_0 <- env.reset(), and for each t: a_t <- pi(o_t), o_{t+1} <- env.step(a_t).
        in_progress, earlier = self._episode, iter(list(self._episode.actions))

        def act(observation: Observation) -> Action:
            if (action := next(earlier, None)) is None:
                action = self._act(observation)
                in_progress.actions.append(action)
            return action

        name = f"agent-{counters.episodes:07d}"
        recorder = EpisodeRecorder(name, self.reward_model.reads_environment_reward)
        start = episode_seed(self.seed, counters.episodes)
        for number, step in enumerate(rollout(self.environment, act, start), start=1):
            recorder.add(step)
            if number <= in_progress.learned:
                continue
            counters.agent_steps += 1
            metrics += self._update_agent()
            metrics += self._update_reward()
            in_progress.learned = number
            if self.interruption.requested:
                counters.interactive_seconds += self._watch.lap()
                self.interruption.stop_if_requested()
        self._episode = None

        # r_{t+1} <- -||f(o_{0:t+1}) - f(o_{e,0:t+1})||, for all t at once. Save into D, and the video into D_a.
        episode = recorder.episode()
        if self.featurizer is not None:
            episode = replace(episode, video=self.featurizer.with_features(episode.video))
        rewards = self.reward_model.label(episode.video, references)
        mean_reward = float(rewards.mean())
        self.replay.add(episode, rewards)
        self.agent_videos.add(episode.video)
        counters.episodes += 1
        counters.interactive_seconds += self._watch.lap()
        return [*metrics, {"episode/learned_reward": mean_reward}]

    @property
    def steps_in_progress(self) -> int:
        """Agent steps that were learned from in an episode that was left before its end."""
        return 0 if self._episode is None else self._episode.learned

    @property
    def in_progress(self) -> bool:
        """Whether an episode was left before its end."""
        return self._episode is not None

    @property
    def cloning_due(self) -> bool:
        """Whether a Cloning Phase comes next: with demonstrations, once the warm-up is over and between episodes."""
        if self.demonstrations is None or self._warming_up or self.in_progress:
            return False
        return cloning_due(self.demonstrations, self.counters, self.budget)

    @property
    def _warming_up(self) -> bool:
        return self.counters.agent_steps < self.agent.config.warm_up_steps or len(self.replay) == 0

    def _act(self, observation: Observation) -> Action:
        """a_t in [-1, 1]: the policy's, with noise; in the warm-up a random one, held for some steps."""
        if not self._warming_up:
            return self.agent.act(observation, self.budget.scheduled_steps(self.counters), explore=True)
        if self._held_steps == 0:
            self._held_steps = int(self.rng.integers(1, self.agent.config.warm_up_hold + 1))
            self._held_action = self.rng.uniform(-1.0, 1.0, self._held_action.shape).astype(np.float32)
        self._held_steps -= 1
        return self._held_action

    def _update_agent(self) -> list[StepMetrics]:
        """(o, a, o', r) <- sample(D); using DrQ-v2 update Q, pi. Every `update_every` agent steps."""
        if self._warming_up or self.counters.agent_steps % self.agent.config.update_every:
            return []
        if self.demonstrations is not None and not self.counters.cloning_phases:
            return []  # the warm-up has ended in this episode, and cloning comes first
        metrics = self.agent.update(self._batch(), self.budget.scheduled_steps(self.counters))
        self.counters.agent_updates += 1
        return [metrics]

    def _batch(self) -> Batch:
        size = self.agent.config.batch_size
        if self.demonstrations is None:
            return self.replay.sample(size, self.rng)
        return self.demonstrations.mixed(self.replay, size, self.rng)

    def _update_reward(self) -> list[StepMetrics]:
        """If step <= N_train and step mod N_update = 0: sample from D_e and D_a, evaluate L, optimize the reward."""
        model, counters = self.reward_model, self.counters
        if self.reward_rests or self._warming_up or counters.agent_steps % self.config.reward_update_every:
            return []
        resting = self.budget.scheduled_steps(counters) > self.config.reward_updates_until
        if resting and not model.keeps_learning:
            return []
        version = model.version
        metrics = model.update(self.expert, self.shown_agent_videos)
        if model.version == version:
            return [metrics]  # nothing was learned, so no stored reward is stale
        counters.reward_updates += 1
        # Beyond the paper: stored rewards follow the reward as it learns.
        if isinstance(model, SeesFrames) and self.replay.keeps_states:
            if counters.reward_updates % RELABEL_EVERY == 0:
                self.replay.relabel_all(model.score)
                if self.demonstrations is not None:
                    self.demonstrations.relabel_all(model)
        else:
            for _ in range(self.config.relabel_episodes):
                self._relabel_one()
        return [metrics]

    def _relabel_one(self) -> None:
        """Rewards a stored episode anew, so that replay follows the reward as it learns."""
        ids = self.replay.episode_ids
        kept = range(max(ids.start, ids.stop - len(self.agent_videos)), ids.stop)
        episode_id = int(self.rng.integers(kept.start, kept.stop))
        slot = self.agent_videos.slot_of(age=ids.stop - 1 - episode_id)
        references = draw_references(self.reward_model, self.expert, self.rng)
        rewards = self.reward_model.label(self.agent_videos[slot], references)
        # An episode that ended early stands still in the ring up to the full length; no reward looks ahead at that.
        rewards = rewards[: self.replay.agent_steps_of(episode_id)]
        self.replay.relabel(episode_id, rewards)

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


def episode_seed(run_seed: int, episode: int) -> int:
    """The seed of an episode's start, a function of the run's seed and the episode's number alone, so that a
    resumed run meets the same starts."""
    return int(np.random.SeedSequence([run_seed, 0, episode]).generate_state(1)[0])
