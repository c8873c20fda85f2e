"""What a run learned, in numbers and sentences: the head of the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np

from bootifol.errors import BootifolError
from bootifol.evaluation.ranking import RankingScores, expert_above_random, ranking_scores
from bootifol.evaluation.sight import SEES, against_kinds, in_words
from bootifol.evaluation.summary import Summary, summarize
from bootifol.evaluation.tables import EvaluationRow, RankingRow
from bootifol.reports.final_return import FinalReturn, final_return
from bootifol.reports.names import clones, hears_reward
from bootifol.reports.run_files import ALIGNMENT, CLONING, INTERACTIVE, RunFiles
from bootifol.reports.style import short_number

Verdict = Literal["good", "fair", "poor"]
Direction = Literal["up", "down", "unclear"]
Item = TypeVar("Item")

FEWEST_EVALUATIONS = 8
"""Of which a quarter is two: from one evaluation to the next a policy comes and goes."""

FEWEST_STARTS = 5
"""Of evaluation episodes at either end: a bootstrap interval of fewer is no interval."""

LEAST_OF_A_PHASE = 0.5
"""Fraction of its gradient steps below which a phase was cut off."""

FEWEST_REWARDS = 20
"""Records of the learned reward; a quarter is five."""


def _percent(value: float) -> str:
    return f"{value:.0%}".replace("-", "\N{MINUS SIGN}")


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
    """What the run learned: its policy, its reward, what cloning did, and whether return followed reward."""
    found = [_cut_off(run), _policy(run), _reward(run), _cloning(run), _following(run), _showcase(run)]
    return [finding for finding in found if finding is not None]


def _cut_off(run: RunFiles) -> Finding | None:
    """What time left too little of: a phase, or all of the agent's updates."""
    if run.time_budget is None:
        return None
    cut = []
    for phase, wanted in _gradient_steps_wanted(run).items():
        curves = [curve for (of_phase, _), curve in run.curves.items() if of_phase == phase and len(curve)]
        done = max((int(curve.steps[-1]) for curve in curves), default=wanted)
        if done < LEAST_OF_A_PHASE * wanted:
            cut.append(f"{phase} took {done:,} of its {wanted:,} gradient steps")
    if run.agent_steps and run.curve(INTERACTIVE, "agent/critic_loss") is None:
        cut.append("the agent had no update")
    if not cut:
        return None
    text = f"The time was too short: {' and '.join(cut)}."
    return Finding("poor", f"{text} Give a longer --time-budget, or a quicker --preset.")


def _gradient_steps_wanted(run: RunFiles) -> dict[str, int]:
    """By phase, as far as the configuration tells: of the Alignment Phase and of one Cloning Phase."""

    def field(part: str, name: str) -> float:
        value = run.config.get(part, {}).get(name, 0)
        return value if isinstance(value, int | float) else 0

    wanted = {ALIGNMENT: field("alignment", "gradient_steps")}
    if field("demonstrations", "fraction") > 0:
        updates = ("inverse_dynamics_updates", "cloning_updates")
        wanted[CLONING] = sum(field("demonstrations", name) for name in updates)
    return {phase: int(count) for phase, count in wanted.items()}


def _policy(run: RunFiles) -> Finding | None:
    final = final_return(run)
    if final is None:
        return None
    if final.scaled_return is None:
        return _policy_without_scale(run, final)
    value = final.scaled_return.mean
    levels = run.return_levels(final.episode_steps)
    ends = "" if levels is None else f" (random {short_number(levels[0])}, expert {short_number(levels[1])})"
    solved = (
        ""
        if final.successes is None
        else f", {final.successes} of {final.scaled_return.count} episodes solved"
    )
    text = (
        f"The policy returns {short_number(final.environment_return.mean)} in {final.episode_steps} agent steps{ends}: "
        f"{_percent(value)} of the way from random to expert{solved}."
    )
    if value < 0:
        text += " It is worse than random actions."
    return Finding(_verdict(value, good=0.8, fair=0.2), text)


def _policy_without_scale(run: RunFiles, final: FinalReturn) -> Finding:
    """Nobody measured an expert: what can be said are successes, and random actions from the same few starts."""
    mean = short_number(final.environment_return.mean)
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
        agent, random = (short_number(float(np.mean(of_kind))) for of_kind in returns.values())
        text += f", and in the training episodes shown below {agent} where random actions return {random}"
    if final.successes is not None:
        count = final.environment_return.count
        verdict = _verdict(final.successes / count, good=0.8, fair=0.2)
        return Finding(verdict, f"{text}; {final.successes} of {count} episodes solved.")
    return Finding("fair", f"{text}. The task has no measured expert, so there is no scale.")


def _reward(run: RunFiles) -> Finding | None:
    return _sight(run) or _order_of_videos(run)


def _sight(run: RunFiles) -> Finding | None:
    """Whether the reward tells the expert from plausible failures; None where nobody could play them, or where the
    record of it is damaged."""
    moments = run.sight_moments()
    last = next(reversed(moments.values()), {})
    against = against_kinds(last)
    if not against or "spearman" not in last:
        return None
    text = in_words(last)
    if len(moments) > 1:
        first = against_kinds(next(iter(moments.values())))
        worst = min(first, key=first.__getitem__, default=None)
        if worst is not None:
            text += f"; before the agent acted it was {_percent(first[worst])} at worst ({worst.replace('_', ' ')})"
    return Finding(_verdict(min(against.values()), good=0.95, fair=SEES), f"{text[0].upper()}{text[1:]}.")


def _order_of_videos(run: RunFiles) -> Finding | None:
    scored = [(steps, scores_or_none(rows)) for steps, rows in run.ranking_moments().items()]
    known = [(steps, scores) for steps, scores in scored if scores is not None]
    if not known:
        return _reward_without_half_good(run)
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


def _reward_without_half_good(run: RunFiles) -> Finding | None:
    """All that imported videos can tell: nobody filmed a performer that is half as good."""
    fractions = [
        expert_above_random(rows)
        for rows in run.ranking_moments().values()
        if {"expert", "random"} <= {row.kind for row in rows}
    ]
    if not fractions:
        return None
    text = f"The reward puts an unseen expert video above a random one in {fractions[-1]:.0%} of pairs (a coin: 50%)"
    if len(fractions) > 1:
        text += f"; before the agent acted it was {fractions[0]:.0%}"
    text += ". Without half-good videos nothing tells how it ranks what comes between."
    return Finding(_verdict(fractions[-1], good=0.95, fair=0.8), text)


def _cloning(run: RunFiles) -> Finding | None:
    """From where to where the first Cloning Phase took the true return, and where it was after the last."""
    if CLONING not in run.phase_seconds or not clones(run) or not run.episode_lengths():
        return None
    began, ended = run.phase_seconds[CLONING]
    length = run.episode_lengths()[0]
    evaluations = list(run.evaluations_of(length).values())
    # A Cloning Phase ends with an evaluation, and has none within.
    before = [rows for rows in evaluations if rows[0].seconds < began][-1:]
    after = [rows for rows in evaluations if rows[0].seconds >= began][:1]
    after_last = [rows for rows in evaluations if rows[0].seconds >= ended][:1]
    change = _change_of_returns(before, after)
    if change is None:
        return None
    text = (
        f"Cloning the videos took the true return in {length} agent steps from {short_number(change.first.mean)} to "
        f"{short_number(change.last.mean)}"
    )
    if after_last and after_last != after:
        mean = np.mean([row.environment_return for row in after_last[0]])
        text += f"; after the last Cloning Phase it was {short_number(float(mean))}"
    verdict: dict[Direction, Verdict] = {"up": "good", "unclear": "fair", "down": "poor"}
    return Finding(verdict[change.direction], f"{text}.")


def _following(run: RunFiles) -> Finding | None:
    """Did the agent's reward rise, and the true return with it?

    First and last quarter of what was measured are compared; where there was a Cloning Phase, of what was measured
    after it, for the return jumps there without the reward's doing. The method that learns from the true return and
    a policy that hears no reward have nothing to tell.
    """
    cloned = clones(run) and CLONING in run.phase_seconds
    reward = run.curve(INTERACTIVE, "episode/learned_reward")
    if reward is None or run.method == "environment" or not hears_reward(run):
        return None
    ended = run.phase_seconds[CLONING][1] if cloned else 0.0
    length = run.episode_lengths()[0] if run.episode_lengths() else 0
    evaluations = {
        steps: rows for steps, rows in run.evaluations_of(length).items() if rows[0].seconds >= ended
    }
    rewards = reward.values[reward.steps > min(evaluations)] if cloned and evaluations else reward.values
    if len(evaluations) < FEWEST_EVALUATIONS or len(rewards) < FEWEST_REWARDS:
        return None
    earned = Change(*(summarize(values) for values in _quarters(list(rewards))))
    returned = _change_of_returns(*_quarters(list(evaluations.values())))
    if returned is None:
        return None
    text = (
        f"{'After the Cloning Phase' if cloned else 'In its training episodes'} the agent earned a learned reward of "
        f"{short_number(earned.first.mean)} per step at first and {short_number(earned.last.mean)} at last"
    )
    ends = f"from {short_number(returned.first.mean)} to {short_number(returned.last.mean)} in {length} agent steps"
    if cloned:
        return _after_cloning(returned.direction, text, ends)
    policy = _policy(run)
    return _without_cloning(
        earned.direction, returned.direction, text, ends, policy is None or policy.verdict == "poor"
    )


def _after_cloning(returned: Direction, text: str, ends: str) -> Finding:
    if returned == "up":
        return Finding(
            "fair",
            f"{text}, and its true return rose {ends}. It goes on imitating the videos, so this does not show that "
            "the reward leads to the task.",
        )
    if returned == "down":
        return Finding(
            "poor", f"{text}, and its true return fell {ends}: what it learned then spoiled the clone."
        )
    return Finding(
        "fair",
        f"{text}, and its true return went {ends}, no clear change: what it learned then neither clearly improved "
        "nor clearly spoiled the clone.",
    )


def _without_cloning(earned: Direction, returned: Direction, text: str, ends: str, poor: bool) -> Finding:
    """`poor`: where the policy ended far from the task."""
    if returned == "up" and earned == "up":
        return Finding(
            "good", f"{text}, and its true return rose with it {ends}: the reward leads to the task."
        )
    if returned == "up":
        return Finding(
            "fair",
            f"{text}: no clear rise although the true return rose {ends}. The reward model changes while the agent "
            "learns, so rewards of different times are not on one scale.",
        )
    if returned == "down" and earned == "up":
        return Finding(
            "poor",
            f"{text}, but its true return fell {ends}: it follows a reward that leads away from the task.",
        )
    if returned == "down":
        return Finding("poor", f"{text}, and its true return fell {ends}.")
    unclear = f"its true return did not clearly rise ({ends})"
    if not poor:
        return Finding("fair", f"{text}, and {unclear}.")
    if earned == "up":
        return Finding("poor", f"{text}, but {unclear}: it follows a reward that does not lead to the task.")
    return Finding("poor", f"{text}, and {unclear} either: it has not learned to earn the reward.")


def _showcase(run: RunFiles) -> Finding | None:
    totals = {
        kind: float(np.mean([video.rewards.sum() for (k, _), video in run.showcase.items() if k == kind]))
        for kind in ("expert", "agent", "random")
        if any(k == kind for k, _ in run.showcase)
    }
    if len(totals) < 3:
        return None
    text = (
        f"From the same starts, an episode earns a learned reward of {short_number(totals['expert'])} when the expert "
        f"acts, {short_number(totals['agent'])} for the agent and {short_number(totals['random'])} for random actions"
    )
    if totals["expert"] <= totals["random"]:
        return Finding("poor", f"{text}: the reward does not tell expert from random here.")
    position = (totals["agent"] - totals["random"]) / (totals["expert"] - totals["random"])
    return Finding(_verdict(position, good=0.7, fair=0.2), f"{text}.")


@dataclass(frozen=True)
class Change:
    """What was measured at first and at last."""

    first: Summary
    last: Summary

    @property
    def direction(self) -> Direction:
        """Up or down only where the two intervals lie apart."""
        if self.first.interval is None or self.last.interval is None:
            return "unclear"
        if self.last.interval[0] > self.first.interval[1]:
            return "up"
        return "down" if self.last.interval[1] < self.first.interval[0] else "unclear"


def _change_of_returns(
    first: Sequence[Sequence[EvaluationRow]], last: Sequence[Sequence[EvaluationRow]]
) -> Change | None:
    """Between evaluations; None where either end has too few starts to tell.

    A start that was evaluated several times counts once, with the mean of its returns: the same few starts played again
    and again do not make the mean of all starts surer.
    """
    ends = []
    for evaluations in (first, last):
        by_start: dict[int, list[float]] = {}
        for rows in evaluations:
            for row in rows:
                by_start.setdefault(row.seed, []).append(row.environment_return)
        if len(by_start) < FEWEST_STARTS:
            return None
        ends.append(summarize([np.mean(returns) for returns in by_start.values()]))
    return Change(*ends)


def _quarters(values: Sequence[Item]) -> tuple[Sequence[Item], Sequence[Item]]:
    """The first and the last quarter."""
    quarter = len(values) // 4
    return values[:quarter], values[-quarter:]


def _verdict(value: float, good: float, fair: float) -> Verdict:
    if value >= good:
        return "good"
    return "fair" if value >= fair else "poor"
