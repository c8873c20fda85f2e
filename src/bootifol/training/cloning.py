"""Cloning Phase: the policy becomes a clone of the expert videos, with inferred actions.

It goes beyond the paper, and only runs with `demonstrations` have it: once when the agent's warm-up ends, whose steps
are what the inverse dynamics learns from, and again whenever there are enough newer ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bootifol.agents.drqv2 import DrQv2
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.base import RewardModel
from bootifol.training.budget import Budget, Counters, Stopwatch
from bootifol.training.demonstrations import Demonstrations
from bootifol.types import Metrics


def cloning_phase(
    agent: DrQv2,
    demonstrations: Demonstrations,
    agent_replay: ReplayBuffer,
    reward_model: RewardModel,
    rng: np.random.Generator,
    budget: Budget,
    counters: Counters,
) -> Iterator[Metrics]:
    """Learns the inverse dynamics, names the videos' actions and rewards, and clones them.

    Args:
        agent: its encoder and actor are trained.
        demonstrations: the expert videos.
        agent_replay: the agent's own steps, of its warm-up.
        reward_model: rewards the expert videos.
        rng: draws batches and references.
        budget: a run whose time is over ends the phase.
        counters: `inverse_dynamics_updates`, `cloning_updates` and `cloning_seconds` are kept up to date.

    Yields:
        The metrics of each gradient step.
    """
    watch = Stopwatch()
    config = demonstrations.config
    if not cloning_in_progress(demonstrations, counters):
        counters.cloning_phases += 1
    inverse_dynamics_before, cloning_before = config.updates_until(counters.cloning_phases - 1)
    inverse_dynamics_updates, cloning_updates = config.updates_until(counters.cloning_phases)
    while not budget.ended(counters) and counters.inverse_dynamics_updates < inverse_dynamics_updates:
        share = one_cycle(
            counters.inverse_dynamics_updates, inverse_dynamics_before, inverse_dynamics_updates
        )
        learning_rate = share * config.inverse_dynamics_learning_rate
        metrics = demonstrations.learn_inverse_dynamics(agent_replay, rng, learning_rate)
        counters.inverse_dynamics_updates += 1
        counters.cloning_seconds += watch.lap()
        yield metrics
    if demonstrations.refreshes < counters.cloning_phases:
        demonstrations.refresh(counters.agent_steps, reward_model, rng)
        counters.cloning_seconds += watch.lap()
    while not budget.ended(counters) and counters.cloning_updates < cloning_updates:
        share = one_cycle(counters.cloning_updates, cloning_before, cloning_updates)
        batch = demonstrations.sample(agent.config.batch_size, rng)
        metrics = agent.clone(batch, share * config.cloning_learning_rate)
        counters.cloning_updates += 1
        counters.cloning_seconds += watch.lap()
        yield metrics


def one_cycle(done: int, first: int, end: int) -> float:
    """What share of its highest value a learning rate has at gradient step `done` of those from `first` to `end`.

    It rises for a twentieth of them and falls to 0 with half a cosine, so that the parameters come to rest.
    """
    passed = (done - first + 1) / (end - first + 1)
    rise = 0.05
    if passed < rise:
        return passed / rise
    return 0.5 + 0.5 * math.cos(math.pi * (passed - rise) / (1 - rise))


def cloning_in_progress(demonstrations: Demonstrations, counters: Counters) -> bool:
    """Whether a Cloning Phase was begun and has not ended."""
    done = counters.inverse_dynamics_updates, counters.cloning_updates
    return (
        done != demonstrations.config.updates_until(counters.cloning_phases)
        or demonstrations.refreshes < counters.cloning_phases
    )


def cloning_due(demonstrations: Demonstrations, counters: Counters, budget: Budget) -> bool:
    """Whether a Cloning Phase comes next, once the warm-up is over."""
    if counters.cloning_phases == 0 or cloning_in_progress(demonstrations, counters):
        return True
    config = demonstrations.config
    return (
        counters.agent_steps - demonstrations.refreshed_at >= config.repeat_every
        and budget.scheduled_steps(counters) <= config.repeat_until
    )


def cloning_extent(demonstrations: Demonstrations, counters: Counters) -> tuple[int, int]:
    """Gradient steps of the phase that is due: how many are done, and how many there are."""
    phases = counters.cloning_phases + (not cloning_in_progress(demonstrations, counters))
    before, until = (sum(demonstrations.config.updates_until(count)) for count in (phases - 1, phases))
    return counters.inverse_dynamics_updates + counters.cloning_updates - before, until - before
