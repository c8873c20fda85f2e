"""What a run learned, in numbers and sentences: the head of the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bootifol.errors import BootifolError
from bootifol.evaluation.ranking import RankingScores, ranking_scores
from bootifol.evaluation.tables import RankingRow
from bootifol.reports.final_return import FinalReturn, final_return
from bootifol.reports.run_files import CLONING, INTERACTIVE, Curve, RunFiles

Verdict = Literal["good", "fair", "poor"]


def number(value: float) -> str:
    """A value for reading: three digits that count, and a real minus sign."""
    text = f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return text.replace("-", "\N{MINUS SIGN}")


@dataclass(frozen=True)
class Finding:
    """One sentence and how good its news are."""

    verdict: Verdict
    text: str


def scores_or_none(rows: Sequence[RankingRow]) -> RankingScores | None:
    """The scores of a ranking; None where a kind is missing."""
    try:
        return ranking_scores(rows)
    except BootifolError:
        return None


def findings(run: RunFiles) -> list[Finding]:
    """What the run learned: its policy, its reward, and whether the one followed the other."""
    found = [_policy(run), _reward(run), _following(run), _showcase(run)]
    return [finding for finding in found if finding is not None]


def _policy(run: RunFiles) -> Finding | None:
    final = final_return(run)
    if final is None:
        return None
    if final.scaled_return is None:
        return _policy_without_scale(run, final)
    value = final.scaled_return.mean
    levels = run.return_levels(final.episode_steps)
    ends = "" if levels is None else f" (random {number(levels[0])}, expert {number(levels[1])})"
    solved = (
        ""
        if final.successes is None
        else f", {final.successes} of {final.scaled_return.count} episodes solved"
    )
    text = (
        f"The policy returns {number(final.environment_return.mean)} in {final.episode_steps} agent steps{ends}: "
        f"{value:.0%} of the way from random to expert{solved}."
    )
    return Finding(_verdict(value, good=0.8, fair=0.2), text)


def _policy_without_scale(run: RunFiles, final: FinalReturn) -> Finding:
    """Nobody measured an expert: what can be said are successes, and random actions from the same few starts."""
    mean = number(final.environment_return.mean)
    text = f"The policy returns {mean} in episodes of {final.episode_steps} agent steps"
    returns = {
        kind: [
            video.environment_return
            for (k, _), video in run.showcase.items()
            if k == kind and video.environment_return is not None
        ]
        for kind in ("agent", "random")
    }
    if all(returns.values()):
        agent, random = (number(float(np.mean(of_kind))) for of_kind in returns.values())
        text += f", and in the training episodes shown below {agent} where random actions return {random}"
    if final.successes is not None:
        count = final.environment_return.count
        verdict = _verdict(final.successes / count, good=0.8, fair=0.2)
        return Finding(verdict, f"{text}; {final.successes} of {count} episodes solved.")
    return Finding("fair", f"{text}. The task has no measured expert, so there is no scale.")


def _reward(run: RunFiles) -> Finding | None:
    scored = [(steps, scores_or_none(rows)) for steps, rows in run.ranking_moments().items()]
    known = [(steps, scores) for steps, scores in scored if scores is not None]
    if not known:
        return None
    steps, last = known[-1]
    text = (
        f"The reward puts an unseen expert video above a half-good one in {last.expert_above_half_good:.0%} of "
        f"pairs, and half-good above random in {last.half_good_above_random:.0%} (a coin: 50%)"
    )
    first_steps, first = known[0]
    if first_steps != steps:
        before = f"{first.expert_above_half_good:.0%} and {first.half_good_above_random:.0%}"
        text += f"; before the agent acted it was {before}"
    weakest = min(last.expert_above_half_good, last.half_good_above_random)
    return Finding(_verdict(weakest, good=0.8, fair=0.6), text + ".")


def _following(run: RunFiles) -> Finding | None:
    """Did the agent's reward rise, and the true return with it?"""
    reward = run.curve(INTERACTIVE, "episode/learned_reward")
    lengths = run.episode_lengths()
    if reward is None or len(reward) < 20 or not lengths:
        return None
    returns = [
        float(np.mean([row.environment_return for row in rows]))
        for rows in run.evaluations_of(lengths[0]).values()
    ]
    if len(returns) < 4:
        return None
    early, late, spread = _change(reward)
    rises = late > early + spread
    quarter = max(1, len(returns) // 4)
    improves = np.mean(returns[-quarter:]) > np.mean(returns[:quarter]) + np.std(returns[:quarter])
    text = (
        f"Per step of its episodes the agent earned a learned reward of {number(early)} at first "
        f"and {number(late)} at last"
    )
    if rises and improves and any(phase == CLONING for phase, _ in run.curves):
        return Finding(
            "fair",
            f"{text}, and its true return rose with it. The policy became a clone of the videos in between, so this "
            "does not show that the reward leads to the task.",
        )
    if rises and improves:
        return Finding("good", f"{text}, and its true return rose with it: the reward leads to the task.")
    if rises:
        return Finding(
            "poor",
            f"{text}, but its true return did not rise: it follows a reward that does not lead to the task.",
        )
    if improves:
        return Finding(
            "fair",
            f"{text}: no clear rise although the true return rose. The encoder moves while the agent learns, "
            "so rewards of different times are not on one scale.",
        )
    return Finding(
        "poor", f"{text}, and its true return did not rise either: it has not learned to earn the reward."
    )


def _showcase(run: RunFiles) -> Finding | None:
    totals = {
        kind: float(np.mean([video.rewards.sum() for (k, _), video in run.showcase.items() if k == kind]))
        for kind in ("expert", "agent", "random")
        if any(k == kind for k, _ in run.showcase)
    }
    if len(totals) < 3:
        return None
    text = (
        f"From the same starts, an episode earns a learned reward of {number(totals['expert'])} when the expert acts, "
        f"{number(totals['agent'])} for the agent and {number(totals['random'])} for random actions"
    )
    if totals["expert"] <= totals["random"]:
        return Finding("poor", f"{text}: the reward does not tell expert from random here.")
    position = (totals["agent"] - totals["random"]) / (totals["expert"] - totals["random"])
    return Finding(_verdict(position, good=0.7, fair=0.2), f"{text}.")


def _change(curve: Curve) -> tuple[float, float, float]:
    """Mean of the first and of the last tenth, and the standard deviation within the first."""
    tenth = max(1, len(curve) // 10)
    first, last = curve.values[:tenth], curve.values[-tenth:]
    return float(first.mean()), float(last.mean()), float(first.std())


def _verdict(value: float, good: float, fair: float) -> Verdict:
    if value >= good:
        return "good"
    return "fair" if value >= fair else "poor"
