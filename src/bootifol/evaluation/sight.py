"""Does the learned reward see the task? The expert against those who fail plausibly, as figures.

The true return only judges here: it says who failed, and whether the learned reward orders performances as it does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bootifol.envs.pixels import PixelEnvironment
from bootifol.envs.rollout import play_episode
from bootifol.evaluation.ranking import area_under_curve
from bootifol.experts import make_expert
from bootifol.experts.failures import failures_of, make_failure
from bootifol.types import Metrics, Rewards, Video

SEES = 0.8
"""Chance that the expert is rewarded above its worst kind of failure, below which the reward is not said to see."""

FIRST_SEED = 10**6
"""Of each performer's episodes; all play the same starts."""


@dataclass(frozen=True)
class Performance:
    """One episode, judged twice."""

    performer: str
    """expert, or one of `experts.failures.KINDS`."""

    true_rewards: Rewards
    """The environment's, `[T]`."""

    learned_rewards: Rewards
    """The learned reward's, `[T]`."""


def perform(
    task_name: str,
    environment: PixelEnvironment,
    label: Callable[[Video], Rewards],
    episodes: int,
) -> Iterator[Performance]:
    """Everyone plays the same starts: the expert, then each failure.

    Args:
        task_name: from the catalogue; it has an expert.
        environment: the task's.
        label: the learned reward of a video, `[T]`.
        episodes: of each performer.
    """
    for performer in ("expert", *failures_of(task_name, environment)):
        for seed in range(FIRST_SEED, FIRST_SEED + episodes):
            act = (
                make_expert(task_name, environment)
                if performer == "expert"
                else make_failure(performer, task_name, environment, seed)
            )
            name = f"{performer}-{seed}"
            played = play_episode(environment, act, seed, name, keep_environment_rewards=True)
            video = played.episode.video
            assert video.environment_rewards is not None
            # The learned reward gets pictures alone.
            yield Performance(performer, video.environment_rewards, label(Video(name, video.frames)))


def sight(performances: Sequence[Performance]) -> Metrics:
    """What the performances say, by name.

    `auc:KIND`: the chance that an episode of the expert is rewarded above one of that kind that failed (`failures`).
    Kinds that fail in fewer than a quarter of their episodes are left out. `spearman`: rank correlation of learned and
    true return over all episodes. `step_auc`, where the true reward of a step takes few values, half of them or
    more 0: the chance that a step with half of the highest or more is rewarded above one with none.
    """
    true, learned = returns(performances)
    names = np.array([performance.performer for performance in performances])
    failing = failures(performances)
    figures = {}
    for kind in dict.fromkeys(names):
        failed = (names == kind) & failing
        if kind != "expert" and failed.sum() >= (names == kind).sum() / 4:
            figures[f"auc:{kind}"] = area_under_curve(learned[names == "expert"], learned[failed])
    rank = float(stats.spearmanr(learned, true).statistic)
    figures["spearman"] = rank if np.isfinite(rank) else 0.0  # undefined where all rewards are equal
    steps = np.concatenate([performance.true_rewards for performance in performances])
    if np.mean(steps == 0) >= 0.5:
        of_steps = np.concatenate([performance.learned_rewards for performance in performances])
        on, off = of_steps[steps >= steps.max() / 2], of_steps[steps == 0]
        figures["step_auc"] = area_under_curve(on, off)
    return figures


def failures(performances: Sequence[Performance]) -> NDArray[np.bool_]:
    """Which of them failed, `[n]`: their true return is at most halfway from the worst kind's to the expert's."""
    true, _ = returns(performances)
    names = np.array([performance.performer for performance in performances])
    means = {name: float(true[names == name].mean()) for name in set(names)}
    failed: NDArray[np.bool_] = true <= (means["expert"] + min(means.values())) / 2
    return failed


def returns(performances: Sequence[Performance]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """True and learned returns, float64 `[n]` each."""
    true = np.array([performance.true_rewards.sum(dtype=np.float64) for performance in performances])
    learned = np.array([performance.learned_rewards.sum(dtype=np.float64) for performance in performances])
    return true, learned


def against_kinds(figures: Metrics) -> Metrics:
    """The AUCs by kind of failure."""
    return {name.removeprefix("auc:"): value for name, value in figures.items() if name.startswith("auc:")}


def in_words(figures: Metrics) -> str:
    """One sentence: the failure that the reward tells worst from the expert, and the rank correlation."""
    against = against_kinds(figures)
    if not against:
        return f"nobody failed at this task; Spearman with the true return {figures['spearman']:.2f}"
    worst = min(against, key=against.__getitem__)
    on_target = (
        f", a step on the target above one off it {figures['step_auc']:.0%}" if "step_auc" in figures else ""
    )
    verdict = "sees" if against[worst] >= SEES else "does not see the whole task"
    return (
        f"the learned reward {verdict}: expert above {len(against)} kinds of plausible failures, {against[worst]:.0%} "
        f"of pairs at worst ({worst.replace('_', ' ')}){on_target}; Spearman with the true return "
        f"{figures['spearman']:.2f}"
    )
