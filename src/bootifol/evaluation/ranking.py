"""Does the learned reward put videos in the right order: expert above half-good above random?

A policy cannot get better than the reward that trains it, so this is measured before and after training, on
videos the reward model was not trained on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from bootifol.errors import BootifolError
from bootifol.evaluation.tables import RankingRow
from bootifol.rewards.base import RewardModel
from bootifol.rewards.references import draw_references
from bootifol.types import Metrics, Video, VideoSource

KINDS = ("random", "half_good", "expert")
"""The kinds whose order is known, from worst to best."""


@dataclass(frozen=True)
class RankingScores:
    """How well the rewards of videos follow the order of `KINDS`."""

    kendall_tau: float
    """Kendall's tau-b between a video's kind and its reward: 0 for no relation, `perfect_tau` at best."""

    perfect_tau: float
    """The tau-b of a perfect order. It is below 1, since videos of one kind are ties that rewards break."""

    expert_above_half_good: float
    """AUC: the chance that an expert video is rewarded above a half-good one (0.5: no better than a coin)."""

    half_good_above_random: float
    """AUC: the chance that a half-good video is rewarded above a random one."""

    expert_margin: float
    """Mean reward of expert minus half-good videos, in units of their pooled standard deviation."""

    half_good_margin: float
    """Mean reward of half-good minus random videos, in units of their pooled standard deviation."""

    def metrics(self) -> Metrics:
        """The scores by the names under which they are logged."""
        return {
            "ranking/kendall_tau": self.kendall_tau,
            "ranking/expert_above_half_good": self.expert_above_half_good,
            "ranking/half_good_above_random": self.half_good_above_random,
            "ranking/expert_margin": self.expert_margin,
            "ranking/half_good_margin": self.half_good_margin,
        }


def rank_videos(
    model: RewardModel,
    videos: Mapping[str, Iterable[Video]],
    expert: VideoSource,
    rng: np.random.Generator,
    agent_steps: int,
) -> list[RankingRow]:
    """Rewards every video as an episode of the agent would be: against references drawn for it alone.

    Args:
        model: the learned reward.
        videos: held-out videos by kind (`KINDS`, and `agent` if wanted).
        expert: the expert videos of training, from which references are drawn.
        rng: draws the references.
        agent_steps: training so far (0: after alignment), for the rows.
    """
    return [
        RankingRow(
            agent_steps=agent_steps,
            kind=kind,
            video=video.name,
            reward=float(np.sum(model.label(video, draw_references(model, expert, rng)), dtype=np.float64)),
        )
        for kind, of_kind in videos.items()
        for video in of_kind
    ]


def ranking_scores(rows: Sequence[RankingRow]) -> RankingScores:
    """Measures the order of the videos in `rows`, all of one moment of training; other kinds are ignored.

    Raises:
        BootifolError: a kind of `KINDS` has no video, or a reward is not finite.
    """
    rewards = _rewards_by_kind(rows)
    levels = np.concatenate([np.full(len(rewards[kind]), level) for level, kind in enumerate(KINDS)])
    values = np.concatenate([rewards[kind] for kind in KINDS])
    tau = float(stats.kendalltau(levels, values, variant="b").statistic)
    perfect_tau = float(stats.kendalltau(levels, np.arange(len(levels)), variant="b").statistic)
    return RankingScores(
        # tau-b is undefined when all rewards are equal: such a reward has no relation to quality.
        kendall_tau=tau if np.isfinite(tau) else 0.0,
        perfect_tau=perfect_tau,
        expert_above_half_good=area_under_curve(rewards["expert"], rewards["half_good"]),
        half_good_above_random=area_under_curve(rewards["half_good"], rewards["random"]),
        expert_margin=margin(rewards["expert"], rewards["half_good"]),
        half_good_margin=margin(rewards["half_good"], rewards["random"]),
    )


Interval = tuple[float, float]
"""Lower and upper end."""


@dataclass(frozen=True)
class RankingIntervals:
    """How sure one can be of `RankingScores`, with so few videos; the rewards themselves are taken as they are."""

    kendall_tau: Interval
    expert_above_half_good: Interval
    half_good_above_random: Interval
    expert_above_random: Interval


def ranking_intervals(
    rows: Sequence[RankingRow], confidence: float = 0.95, resamples: int = 2000, seed: int = 0
) -> RankingIntervals:
    """Percentile bootstrap intervals over videos, drawn with replacement within each kind of `KINDS`.

    The same rows give the same intervals: the resampling has its own generator, from `seed`.

    Raises:
        BootifolError: as `ranking_scores`.
    """
    rewards = _rewards_by_kind(rows)
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(resamples):
        resampled = {kind: rng.choice(of_kind, len(of_kind)) for kind, of_kind in rewards.items()}
        pairs = [area_under_curve(resampled[better], resampled[worse]) for better, worse in _PAIRS]
        drawn.append([_tau_of_pairs(pairs, rewards), *pairs])
    tail = (1.0 - confidence) / 2.0
    low, high = np.quantile(np.array(drawn), [tail, 1.0 - tail], axis=0)
    return RankingIntervals(*[(float(a), float(b)) for a, b in zip(low, high, strict=True)])


_PAIRS = (("expert", "half_good"), ("half_good", "random"), ("expert", "random"))


def _tau_of_pairs(pairs: Sequence[float], rewards: Mapping[str, NDArray[np.float64]]) -> float:
    """Kendall's tau-b from the AUC of each of `_PAIRS`, where no two videos have one reward.

    Of pairs of videos of two kinds the fraction AUC agrees with the order and the rest does not; pairs within a kind
    are ties. Videos drawn twice by the bootstrap are no ties of the reward, so tau is not computed from them directly.
    """
    counts = np.array([len(rewards[better]) * len(rewards[worse]) for better, worse in _PAIRS])
    videos = sum(len(of_kind) for of_kind in rewards.values())
    agreeing_less_others = float(counts @ (2.0 * np.array(pairs) - 1.0))
    return agreeing_less_others / float(np.sqrt(counts.sum() * (videos * (videos - 1) / 2)))


def _rewards_by_kind(rows: Sequence[RankingRow]) -> dict[str, NDArray[np.float64]]:
    rewards = {kind: np.array([row.reward for row in rows if row.kind == kind]) for kind in KINDS}
    for kind, of_kind in rewards.items():
        if len(of_kind) == 0:
            raise BootifolError(f"videos cannot be ranked: there is none of kind {kind}; add one at least")
        if not np.isfinite(of_kind).all():
            raise BootifolError(
                f"videos cannot be ranked: a video of kind {kind} has a reward that is not finite"
            )
    return rewards


EXPERT_ABOVE_RANDOM = "ranking/expert_above_random"
"""Name of the metric of `expert_above_random`."""


def expert_above_random(rows: Sequence[RankingRow]) -> float:
    """AUC: the chance that an expert video is rewarded above a random one, where nobody is half as good.

    Raises:
        BootifolError: one of the two kinds has no video.
    """
    rewards = {
        kind: np.array([row.reward for row in rows if row.kind == kind]) for kind in ("expert", "random")
    }
    for kind, of_kind in rewards.items():
        if len(of_kind) == 0:
            raise BootifolError(f"videos cannot be ranked: there is none of kind {kind}; add one at least")
    return area_under_curve(rewards["expert"], rewards["random"])


def area_under_curve(better: NDArray[np.float64], worse: NDArray[np.float64]) -> float:
    """The fraction of pairs in which the better one `[N]` is above the worse one `[M]`; ties count half."""
    difference = better[:, None] - worse[None, :]
    return float(np.mean(difference > 0) + 0.5 * np.mean(difference == 0))


def margin(better: NDArray[np.float64], worse: NDArray[np.float64]) -> float:
    """Difference of means in units of the pooled standard deviation (Cohen's d).

    Without any spread the margin is 0 for equal means and else cut at ±1000, so that it can be logged.
    """
    difference = float(better.mean() - worse.mean())
    freedom = max(len(better) + len(worse) - 2, 1)
    squares = float(((better - better.mean()) ** 2).sum() + ((worse - worse.mean()) ** 2).sum())
    spread = float(np.sqrt(squares / freedom))
    if difference == 0.0:
        return 0.0
    return float(np.clip(difference / max(spread, 1e-12), -1000.0, 1000.0))
