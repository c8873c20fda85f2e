"""Cloning Phase: the policy becomes a clone of the expert videos, with inferred actions.

It goes beyond the paper, and only runs with `demonstrations` have it: once when the agent's warm-up ends, whose steps
are what the inverse dynamics learns from, and again whenever there are enough newer ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bootifol.agents.drqv2 import DrQv2
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.base import RewardModel
from bootifol.training.budget import Budget, Counters, Stopwatch
from bootifol.training.demonstrations import Demonstrations
from bootifol.types import StepMetrics


class CloningSteps(NamedTuple):
    """Steps of a Cloning Phase, in this order."""

    inverse_dynamics_updates: int
    inferred_videos: int
    cloning_updates: int


def cloning_phase(
    agent: DrQv2,
    demonstrations: Demonstrations,
    agent_replay: ReplayBuffer,
    reward_model: RewardModel,
    rng: np.random.Generator,
    budget: Budget,
    counters: Counters,
) -> Iterator[StepMetrics]:
    """Learns the inverse dynamics, infers the videos' actions and rewards, and clones them.

    Args:
        agent: its encoder and actor are trained.
        demonstrations: the expert videos.
        agent_replay: the agent's own steps.
        reward_model: rewards the expert videos.
        rng: draws batches and references.
        budget: a run whose time is over ends the phase.
        counters: those of Cloning Phases are kept up to date.

    Yields:
        The metrics of each step; a video whose actions and rewards were inferred has none.
    """
    watch = Stopwatch()
    config = demonstrations.config
    if not cloning_in_progress(demonstrations, counters):
        counters.cloning_phases += 1
        counters.cloning_began_at = counters.agent_steps
    first = _steps_until(demonstrations, counters.cloning_phases - 1)
    end = _steps_until(demonstrations, counters.cloning_phases)
    while not budget.ended(counters) and (done := _steps_done(counters)) != end:
        metrics: StepMetrics = {}
        if done.inverse_dynamics_updates < end.inverse_dynamics_updates:
            rate = one_cycle(
                done.inverse_dynamics_updates, first.inverse_dynamics_updates, end.inverse_dynamics_updates
            )
            metrics = demonstrations.learn_inverse_dynamics(
                agent_replay,
                counters.agent_steps - agent.config.warm_up_steps,
                rng,
                rate * config.inverse_dynamics_learning_rate,
            )
            counters.inverse_dynamics_updates += 1
        elif done.inferred_videos < end.inferred_videos:
            demonstrations.infer(done.inferred_videos - first.inferred_videos, reward_model, rng)
            counters.inferred_videos += 1
        else:
            rate = one_cycle(done.cloning_updates, first.cloning_updates, end.cloning_updates)
            batch = demonstrations.sample(agent.config.batch_size, rng)
            metrics = agent.clone(batch, rate * config.cloning_learning_rate)
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
    return _steps_done(counters) != _steps_until(demonstrations, counters.cloning_phases)


def cloning_due(demonstrations: Demonstrations, counters: Counters, budget: Budget) -> bool:
    """Whether a Cloning Phase comes next, once the warm-up is over."""
    if counters.cloning_phases == 0 or cloning_in_progress(demonstrations, counters):
        return True
    config = demonstrations.config
    return (
        counters.cloning_phases < config.phases
        and counters.agent_steps - counters.cloning_began_at >= config.repeat_every
        and budget.seconds_left(counters) >= counters.cloning_seconds / counters.cloning_phases
    )


def cloning_extent(demonstrations: Demonstrations, counters: Counters) -> tuple[int, int]:
    """Steps of the phase that is due: how many are done, and how many there are."""
    phases = counters.cloning_phases + (not cloning_in_progress(demonstrations, counters))
    before, until = (sum(_steps_until(demonstrations, count)) for count in (phases - 1, phases))
    return sum(_steps_done(counters)) - before, until - before


def _steps_done(counters: Counters) -> CloningSteps:
    return CloningSteps(counters.inverse_dynamics_updates, counters.inferred_videos, counters.cloning_updates)


def _steps_until(demonstrations: Demonstrations, cloning_phases: int) -> CloningSteps:
    """Steps when so many phases have ended."""
    config = demonstrations.config
    return CloningSteps(
        cloning_phases * config.inverse_dynamics_updates,
        cloning_phases * len(demonstrations),
        cloning_phases * config.cloning_updates,
    )
