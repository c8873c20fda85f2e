"""What a time budget buys on this machine, measured before the agent acts."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from bootifol.envs.rollout import EpisodeRecorder, rollout
from bootifol.progress import duration
from bootifol.rewards.base import SeesFrames
from bootifol.training.budget import Budget, Counters
from bootifol.training.build import Parts, build_agent, build_environment, build_replay
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig

STEPS = 20
"""Agent steps that are timed."""

UPDATES = 4
"""Updates of an agent that are timed, after one that is not."""

LITTLE = 0.25
"""Below this fraction of the agent steps that the schedules are written for, a budget is said to be small."""


@dataclass(frozen=True)
class Costs:
    """Seconds each takes on this machine, now."""

    agent_step: float
    """One agent step, with the pictures and the policy's action."""
    update: float
    """One update of the agent, its batch included."""
    reward_update: float
    """One gradient step of the reward in the Interactive Phase."""


@dataclass(frozen=True)
class Forecast:
    """What acting and learning will come to."""

    seconds: float
    """For acting and learning."""
    agent_steps: int
    updates: int
    """Of the agent."""
    wanted_steps: int
    """Agent steps that the schedules are written for."""

    @property
    def little(self) -> bool:
        """Whether a quarter of what the schedules are written for is out of reach."""
        return self.agent_steps < LITTLE * self.wanted_steps

    def in_words(self) -> str:
        """A sentence, and what to do where the budget is small."""
        text = (
            f"the budget leaves {duration(self.seconds)} for acting and learning, which buys here about "
            f"{self.agent_steps:,} agent steps and {self.updates:,} updates of the agent; the preset is written for "
            f"{self.wanted_steps:,} agent steps"
        )
        if not self.little:
            return text
        whole = duration(self.seconds * self.wanted_steps / max(self.agent_steps, 1))
        return (
            f"{text}. That is little, and the policy may be no better than chance: those take about {whole} "
            "here, so give a longer --time-budget"
        )


def forecast(run: RunConfig, parts: Parts, budget: Budget, counters: Counters) -> Forecast:
    """Measures what steps and updates cost, in an environment and with an agent that are thrown away.

    Args:
        run: what it is.
        parts: of the run, which are only looked at.
        budget: of the run, with a limit of time.
        counters: after the Alignment Phase.
    """
    config = run.training
    seconds = budget.seconds_left(counters)
    if parts.demonstrations is not None:
        seconds -= budget.cloning_fraction * config.demonstrations.phases * (budget.seconds or 0.0)
    costs = measured_costs(run, parts, counters)
    task, evaluation = parts.task, config.evaluation
    evaluated = evaluation.episodes * task.episode_steps + evaluation.long_episodes * task.evaluation_steps
    steps = affordable_steps(costs, config, max(seconds, 0.0), evaluated)
    updates = max(steps - config.agent.warm_up_steps, 0) // config.agent.update_every
    return Forecast(max(seconds, 0.0), steps, updates, budget.agent_steps)


def affordable_steps(costs: Costs, config: TrainingConfig, seconds: float, evaluated: int) -> int:
    """Agent steps that so many seconds buy.

    Args:
        costs: of each.
        config: says how many updates go with them.
        seconds: for acting, learning and evaluations.
        evaluated: agent steps of one evaluation.
    """
    interactive = config.interactive
    steps = 1 + evaluated / config.evaluation.every
    warm_up = min(config.agent.warm_up_steps * costs.agent_step * steps, seconds)  # nothing learns yet
    at_rest = costs.agent_step * steps + costs.update / config.agent.update_every
    learning = at_rest + costs.reward_update / interactive.reward_update_every
    # Schedules are stretched over the time, so it is a fraction of the time in which the reward learns.
    fraction = min(interactive.reward_updates_until / max(interactive.agent_steps, 1), 1.0)
    learned = (seconds - warm_up) * (fraction / learning + (1 - fraction) / at_rest)
    return int(warm_up / (costs.agent_step * steps) + learned)


def measured_costs(run: RunConfig, parts: Parts, counters: Counters) -> Costs:
    """Acts for a few steps from random parameters, and learns from them a few times."""
    config, length = run.training, parts.task.episode_steps
    environment = build_environment(run, length)
    try:
        agent = build_agent(run, environment, parts.reward_model)
        recorder = EpisodeRecorder("timing")
        steps = rollout(environment, lambda seen: agent.act(seen, 0, explore=True), 0)
        began = time.perf_counter()
        for count, step in enumerate(steps, start=1):
            recorder.add(step)
            if count == STEPS:
                break
        agent_step = (time.perf_counter() - began) / count
    finally:
        environment.close()
    episode = recorder.episode()
    if parts.featurizer is not None:
        episode = replace(episode, video=parts.featurizer.with_features(episode.video))
    replay = build_replay(run, parts.reward_model, length + 1, episode.actions.shape[1])
    replay.add(episode, np.zeros(len(episode.actions), np.float32))
    rng = np.random.default_rng(0)
    for update in range(1 + UPDATES):
        if update == 1:
            began = time.perf_counter()
        agent.update(replay.sample(config.agent.batch_size, rng), 0)
    update_cost = (time.perf_counter() - began) / UPDATES
    # The Alignment Phase's gradient steps are as large; a head on states is smaller than an update of the agent.
    reward_update = counters.alignment_seconds / max(counters.alignment_steps, 1)
    if isinstance(parts.reward_model, SeesFrames):
        reward_update = min(reward_update, update_cost)
    return Costs(agent_step, update_cost, reward_update)
