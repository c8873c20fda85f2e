"""How the learned rewards of runs rank held-out videos, before the agent acts and at the end.

    python -m benchmarks.table_rewards results/suites/reacher_hard

Beside a table of returns it says whether a reward could have taught the policy that stands there: a clone of the videos
gets far with a reward that is at chance. Kendall's tau is 0 at chance and about 0.82 for a perfect order; the last two
columns are how much of the way from random to expert the reward of the agent's own episodes, and of half-good
videos, has come. Values of several seeds are listed, not averaged. Markdown.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.command import command
from bootifol.evaluation.tables import RankingRow
from bootifol.reports.collection import read_runs
from bootifol.reports.comparison import Group, compare
from bootifol.reports.findings import scores_or_none
from bootifol.reports.markdown import markdown_table
from bootifol.reports.names import task_title

HEADER = (
    *(
        "Task",
        "Agent",
        "Seeds",
        "tau before it acts",
        "tau at the end",
        "expert > half-good",
        "half-good > random",
    ),
    *("agent's reward", "half-good's"),
)

Moment = Sequence[RankingRow]


def rows_of(group: Group) -> tuple[str, ...]:
    """The cells of a group of seeds; a dash where a run ranked nothing, as the true reward does."""
    moments = [run.ranking_moments() for run in group.runs]
    first = [each.get(0, []) for each in moments]
    last = [each[max(each)] if each else [] for each in moments]

    def cell(of: Callable[[Moment], float | None], ranked: Sequence[Moment]) -> str:
        found = [of(moment) for moment in ranked]
        told = ["–" if value is None else f"{value:.2f}" for value in found]
        return ", ".join(told) if set(told) != {"–"} else "–"

    return (
        task_title(group.task),
        group.name,
        ", ".join(str(run.seed) for run in group.runs),
        cell(tau, first),
        cell(tau, last),
        cell(expert_above_half_good, last),
        cell(half_good_above_random, last),
        cell(lambda moment: share_of_the_way(moment, "agent"), last),
        cell(lambda moment: share_of_the_way(moment, "half_good"), last),
    )


def tau(moment: Moment) -> float | None:
    scores = scores_or_none(moment)
    return None if scores is None else scores.kendall_tau


def expert_above_half_good(moment: Moment) -> float | None:
    scores = scores_or_none(moment)
    return None if scores is None else scores.expert_above_half_good


def half_good_above_random(moment: Moment) -> float | None:
    scores = scores_or_none(moment)
    return None if scores is None else scores.half_good_above_random


def share_of_the_way(moment: Moment, kind: str) -> float | None:
    """0 where a kind of videos is rewarded as random ones are in the mean, 1 as the expert's.

    None where the expert's are not above the random ones, so that there is no way to go.
    """
    rewards = {
        name: [row.reward for row in moment if row.kind == name] for name in ("random", "expert", kind)
    }
    if not all(rewards.values()):
        return None
    random, expert, asked = (float(np.mean(rewards[name])) for name in ("random", "expert", kind))
    return None if expert <= random else (asked - random) / (expert - random)


@command()
def main(words: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "runs", nargs="+", type=Path, metavar="RUN", help="directories of runs, or that hold some"
    )
    arguments = parser.parse_args(words)
    comparison = compare(read_runs(arguments.runs))
    print(markdown_table(HEADER, [rows_of(group) for group in comparison.groups]))
    for note in comparison.notes:
        print(f"\n- {note}")


if __name__ == "__main__":
    raise SystemExit(main())
