"""Alignment Phase: the first loop of Algorithm 1."""

from __future__ import annotations

from collections.abc import Iterator

from bootifol.rewards.base import RewardModel
from bootifol.training.budget import Budget, Counters, PhaseStep, Stopwatch
from bootifol.types import VideoSource


def alignment_phase(
    reward_model: RewardModel,
    expert: VideoSource,
    random: VideoSource,
    budget: Budget,
    counters: Counters,
    log_every: int,
) -> Iterator[PhaseStep]:
    """Takes gradient steps on expert and random videos until N_pretrain, or the phase's fraction of the time.

    Args:
        reward_model: any method.
        expert: D_e.
        random: videos of a policy that acts at random.
        budget: how long the phase may last.
        counters: `alignment_steps` and `alignment_seconds` are kept up to date.
        log_every: gradient steps from one log line to the next.

    Yields:
        Each gradient step. A method that has nothing to align yields none.
    """
    watch = Stopwatch()
    steps = reward_model.align(expert, random)
    while not budget.alignment_ended(counters):
        # Sample n expert videos and n random ones, evaluate L, optimize theta, gamma, omega, phi.
        metrics = next(steps, None)
        if metrics is None:
            return
        counters.alignment_steps += 1
        counters.alignment_seconds += watch.lap()
        _, done, _ = budget.alignment_extent(counters)
        log_is_due = counters.alignment_steps % log_every == 0
        yield PhaseStep(counters.alignment_steps, done, [metrics], log_is_due)
