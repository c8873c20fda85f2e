"""Cloning Phase: the actions of the expert videos are inferred, and the policy becomes their clone, or does not.

It goes beyond the paper, and only runs with `demonstrations` have it: once when the agent's warm-up ends, whose steps
are what the inverse dynamics learns from, and again whenever there are enough newer ones. Where `cloning_updates` is 0
nothing is cloned: the videos are experience with inferred actions and learned rewards, no more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bootifol.agents.drqv2 import DrQv2
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.base import RewardModel
from bootifol.training.budget import Budget, Counters, PhaseStep, Stopwatch
from bootifol.training.inferred_demonstrations import Demonstrations
from bootifol.types import StepMetrics

INVERSE_DYNAMICS_TIME = 1 / 3
"""Fraction of a Cloning Phase's time, where it is limited, by which the inverse dynamics has learned; all of it where
nothing is cloned."""

INVERSE_DYNAMICS_LEARNING_RATE = 5e-4
"""Of Adam at its highest: in each phase it rises for a twentieth of the gradient steps and falls to 0."""

CLONING_LEARNING_RATE = 1e-3
"""Likewise."""


def cloning_phase(
    agent: DrQv2,
    demonstrations: Demonstrations,
    agent_replay: ReplayBuffer,
    reward_model: RewardModel,
    rng: np.random.Generator,
    budget: Budget,
    counters: Counters,
    log_every: int,
) -> Iterator[PhaseStep]:
    """Learns the inverse dynamics, infers the videos' actions and rewards, and clones them.

    Args:
        agent: its encoder and actor are trained.
        demonstrations: the expert videos.
        agent_replay: the agent's own steps.
        reward_model: rewards the expert videos.
        rng: draws batches and references.
        budget: where it limits the time, the phase ends with its fraction of it, and a run whose time is over ends it.
        counters: those of Cloning Phases are kept up to date.
        log_every: steps from one log line to the next.

    Yields:
        Each step; one in which a video's actions and rewards were inferred has no metrics.
    """
    watch = Stopwatch()
    demonstrations.fill()
    config = demonstrations.config
    inferring = config.inverse_dynamics_updates
    inferring_time = INVERSE_DYNAMICS_TIME if config.clones else 1.0
    cloning, total = inferring + len(demonstrations), steps_of_a_phase(demonstrations)
    if not cloning_in_progress(demonstrations, counters):
        counters.cloning_phases += 1
        counters.cloning_began_at = counters.agent_steps
        counters.cloning_seconds_before = counters.cloning_seconds
    earlier = (counters.cloning_phases - 1) * total
    unlogged = 0
    while not budget.ended(counters) and cloning_in_progress(demonstrations, counters):
        metrics: StepMetrics = {}
        step, time_passed = counters.cloning_steps - earlier, budget.cloning_passed(counters)
        if step < inferring:
            # The inverse dynamics learns from the agent's own steps.
            part_passed = min(time_passed / inferring_time, 1.0)
            rate = one_cycle(step, inferring, part_passed) * INVERSE_DYNAMICS_LEARNING_RATE
            policy_steps = counters.agent_steps - agent.config.warm_up_steps
            metrics = demonstrations.learn_inverse_dynamics(agent_replay, policy_steps, rng, rate)
            last = inferring
        elif step < cloning:
            # A video gets the actions and rewards that are seen in it now.
            demonstrations.infer(step - inferring, reward_model, rng)
            part_passed, last = 0.0, cloning
        else:
            # The policy learns to do what was inferred.
            part_passed = max((time_passed - INVERSE_DYNAMICS_TIME) / (1 - INVERSE_DYNAMICS_TIME), 0.0)
            rate = one_cycle(step - cloning, config.cloning_updates, part_passed)
            rate *= CLONING_LEARNING_RATE
            metrics = agent.clone(demonstrations.sample(agent.config.batch_size, rng), rate)
            last = total
        counters.cloning_steps = earlier + (step + 1 if part_passed < 1 else last)
        counters.cloning_gradient_steps += bool(metrics)
        counters.cloning_seconds += watch.lap()
        done = counters.cloning_steps - earlier
        counters.to_evaluate = int(config.clones and done == total)  # also where the run is stopped just now
        unlogged += bool(metrics)
        log_is_due = unlogged > 0 and (done % log_every == 0 or done == total)
        if log_is_due:
            unlogged = 0
        yield PhaseStep(counters.cloning_gradient_steps, done, [metrics], log_is_due)


def one_cycle(done: int, steps: int, time_passed: float = 0.0) -> float:
    """What fraction of its highest value a learning rate has at gradient step `done` of `steps`.

    It rises for a twentieth of them and falls to 0 with half a cosine, so that the parameters come to rest; where the
    time for them is further on than they are, by that.
    """
    passed = max((done + 1) / (steps + 1), time_passed)
    rise = 0.05
    if passed < rise:
        return passed / rise
    return 0.5 + 0.5 * math.cos(math.pi * (passed - rise) / (1 - rise))


def steps_of_a_phase(demonstrations: Demonstrations) -> int:
    """Gradient steps of the inverse dynamics, videos that they name the actions of, gradient steps of the clone."""
    config = demonstrations.config
    return config.inverse_dynamics_updates + len(demonstrations) + config.cloning_updates


def cloning_in_progress(demonstrations: Demonstrations, counters: Counters) -> bool:
    """Whether a Cloning Phase was begun and has not ended."""
    return counters.cloning_steps < counters.cloning_phases * steps_of_a_phase(demonstrations)


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
