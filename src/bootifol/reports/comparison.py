"""Which runs may be averaged, and what else must be said before their numbers stand beside each other.

Runs are averaged where they differ in their seed alone. Everything that would make an average or a comparison
unfair is told in a sentence: unfinished runs, seeds given twice, mixed configurations or versions, unequal terms.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from bootifol.progress import duration
from bootifol.reports.final_return import final_return
from bootifol.reports.names import LEARN_NOTHING, METHOD_NAMES, agent_name, task_title
from bootifol.reports.run_files import RunFiles, flattened

IRRELEVANT = {"checkpoint_minutes", "tracker", "tensorboard"}
"""Fields of a configuration that change no number of a run; `tensorboard` is of old runs."""

BUDGET = ("time_budget", "interactive.agent_steps")

SHOWN_DIFFERENCES = 6
"""Fields named in one sentence; the rest are counted."""

LONGEST_VARIANT = 3
"""Fields that a variant may be named by; where more would be needed, variants have letters."""

TOLD_APART = ("code", "processor")
"""Of `versions`: what keeps no runs apart, but is told. Else no seed could be added after the next edit."""

READ_NO_VIDEOS = LEARN_NOTHING | {"environment"}


@dataclass(frozen=True)
class Group:
    """Runs of one agent on one task that differ in their seed alone."""

    task: str
    agent: str
    variant: str
    """Where an agent has several groups on a task: what sets this one apart, such as `gradient_steps 0`. Empty for the
    one that has what most have, and where there is no other."""

    runs: tuple[RunFiles, ...]
    """In the order of their seeds."""

    @property
    def name(self) -> str:
        """The agent and its variant."""
        return f"{self.agent} ({self.variant})" if self.variant else self.agent

    @property
    def seeds(self) -> str:
        """Such as `seeds 1, 2`."""
        return f"seed{'s' if len(self.runs) > 1 else ''} {', '.join(str(run.seed) for run in self.runs)}"


@dataclass(frozen=True)
class Comparison:
    """Groups of runs, and what must be said about them."""

    groups: Sequence[Group]
    notes: Sequence[str]
    """One sentence each."""

    def tasks(self) -> list[str]:
        """The tasks, in the order of their first run."""
        return list(dict.fromkeys(group.task for group in self.groups))

    def of(self, task: str) -> list[Group]:
        """The groups of a task."""
        return [group for group in self.groups if group.task == task]


def compare(
    runs: Sequence[RunFiles],
    agent: Callable[[RunFiles], str] = agent_name,
    compared: Collection[str] = (),
    unfinished: bool = False,
) -> Comparison:
    """Sorts runs into groups that may be averaged.

    Args:
        runs: from `read_runs`.
        agent: what a run is compared as, such as its method or the value of an ablated field.
        compared: names of configuration fields that are meant to differ between agents, such as
            `alignment.gradient_steps`; those of the reward methods always are.
        unfinished: whether runs that have not come to their end count too; they are named in any case.
    """
    notes: list[str] = []
    kept = []
    for run in runs:
        reason = unfinished_because(run)
        if reason is None or unfinished:
            kept.append(run)
        if reason is not None:
            fate = "unfinished and counts as far as it has come" if unfinished else "unfinished and left out"
            notes.append(f"{run.path} ({agent(run)} on {task_title(run.task)}) is {fate}: {reason}.")
    groups = _groups(kept, agent, notes)
    for task in dict.fromkeys(group.task for group in groups):
        notes += _mixed([group for group in groups if group.task == task])
        notes += _unequal([group for group in groups if group.task == task], compared)
        notes += _unseen([group for group in groups if group.task == task])
    return Comparison(groups, notes)


def unfinished_because(run: RunFiles) -> str | None:
    """Why a run's numbers are not those of its end; None for a finished run."""
    learns = run.method not in LEARN_NOTHING
    wanted = _count_of(run, "evaluation.final_episodes")
    steps = _count_of(run, "interactive.agent_steps")
    if wanted is None or steps is None:
        return "its config.json does not say how long it trains and in how many episodes it is evaluated then"
    if learns and run.time_budget is None and run.agent_steps < steps:
        return f"it has trained for {run.agent_steps:,} of {steps:,} agent steps"
    seconds = run.seconds or 0.0
    if learns and run.time_budget is not None and seconds < run.time_budget:
        return f"it has trained for {duration(seconds)} of {duration(run.time_budget)}"
    final = final_return(run)
    if final is None or final.agent_steps < run.agent_steps:
        return "its final evaluation is missing"
    if final.environment_return.count < wanted:
        return f"its final evaluation has {final.environment_return.count} of {wanted} episodes"
    return None


def terms(run: RunFiles) -> dict[str, str]:
    """Everything but the seed that a run's numbers depend on, by name; without the sections of other methods."""
    versions = {f"versions.{name}": value for name, value in run.versions.items() if name not in TOLD_APART}
    config = decisive(run.config, run.method)
    return {"time_budget": str(run.time_budget), "demos": run.demos, **config, **versions}


def decisive(config: Mapping[str, Any], method: str) -> dict[str, str]:
    """The fields of a configuration that a method's numbers depend on, by dotted name."""
    others = tuple(f"reward.{other}." for other in METHOD_NAMES if other != method)
    return {
        name: value
        for name, value in flattened(config)
        if name not in IRRELEVANT and not name.startswith(others)
    }


def budget(run: RunFiles) -> str:
    """What a run may spend, in words."""
    if run.method in LEARN_NOTHING:
        return "none"
    if run.time_budget is not None:
        return duration(run.time_budget)
    steps = _count_of(run, "interactive.agent_steps")
    return "an unknown budget" if steps is None else f"{steps:,} agent steps"


def paths_of(runs: Sequence[RunFiles]) -> str:
    """The directories of runs as a shell would expand them: `runs/{seed1,seed2}`."""
    by_parent: dict[Path, list[str]] = {}
    for run in runs:
        by_parent.setdefault(run.path.parent, []).append(run.path.name)
    return ", ".join(
        str(parent / (names[0] if len(names) == 1 else f"{{{','.join(names)}}}"))
        for parent, names in by_parent.items()
    )


def _groups(runs: Sequence[RunFiles], agent: Callable[[RunFiles], str], notes: list[str]) -> list[Group]:
    found: dict[tuple[str, str], dict[frozenset[tuple[str, str]], dict[int | None, RunFiles]]] = {}
    for run in runs:
        variants = found.setdefault((run.task, agent(run)), {})
        seeds = variants.setdefault(frozenset(terms(run).items()), {})
        if run.seed in seeds:
            same = seeds[run.seed].evaluations == run.evaluations
            notes.append(
                f"{run.path} {'is a copy' if same else 'has the seed and the configuration'} of "
                f"{seeds[run.seed].path}, and does not count in an average."
            )
        else:
            seeds[run.seed] = run
    groups = []
    for (task, name), variants in found.items():
        members = [sorted(seeds.values(), key=lambda run: run.seed or 0) for seeds in variants.values()]
        labels = _variant_names([terms(runs[0]) for runs in members])
        groups += [Group(task, name, label, tuple(runs)) for label, runs in zip(labels, members, strict=True)]
    return groups


def _variant_names(variants: Sequence[Mapping[str, str]]) -> list[str]:
    """What sets each set of terms apart: the fields in which it has not what most of them have."""
    fields = [
        name
        for name in dict.fromkeys(name for each in variants for name in each)
        if not _agree(variants, name)
    ]
    usual = {}
    for name in fields:
        (value, count), (_, next_count) = Counter(each.get(name, "absent") for each in variants).most_common(
            2
        )
        usual[name] = value if count > next_count else None
    short = [name.rpartition(".")[2] for name in fields]
    shown = {name: last if short.count(last) == 1 else name for name, last in zip(fields, short, strict=True)}
    named = [
        [
            f"{shown[name]} {each.get(name, 'absent')}"
            for name in fields
            if each.get(name, "absent") != usual[name]
        ]
        for each in variants
    ]
    if max(map(len, named)) > LONGEST_VARIANT:
        return [_letter(number) for number in range(len(variants))]
    return [", ".join(parts) for parts in named]


def _agree(variants: Sequence[Mapping[str, str]], name: str) -> bool:
    return len({each.get(name, "absent") for each in variants}) == 1


def _letter(number: int) -> str:
    """a, b, … z, aa, ab, …"""
    letters = ""
    while number >= 0:
        letters = chr(ord("a") + number % 26) + letters
        number = number // 26 - 1
    return letters


def _mixed(groups: Sequence[Group]) -> list[str]:
    """One sentence for every agent whose runs cannot be averaged."""
    notes = []
    for agent, variants in groupby(groups, key=lambda group: group.agent):
        mixed = list(variants)
        if len(mixed) > 1:
            told = "; ".join(f"({group.variant or 'usual'}) {paths_of(group.runs)}" for group in mixed)
            notes.append(
                f"{agent} on {task_title(mixed[0].task)} is kept apart as {told}, since these differ in more than "
                f"the seed: {_differences(mixed)}."
            )
    return notes


def _unequal(groups: Sequence[Group], compared: Collection[str]) -> list[str]:
    """What is not the same for all agents of a task that learn: budgets, then anything else but what is compared."""
    learners = [group for group in groups if group.runs[0].method not in LEARN_NOTHING]
    if len(learners) < 2:
        return []
    task, notes = task_title(learners[0].task), []
    budgets = {group.name: budget(group.runs[0]) for group in learners}
    if len(set(budgets.values())) > 1:
        told = "; ".join(f"{name}: {spent}" for name, spent in budgets.items())
        notes.append(
            f"Budgets on {task} are unequal ({told}), so these numbers do not compare methods alone."
        )
    by_agent = groupby(learners, key=lambda group: group.agent)
    firsts = [min(variants, key=lambda group: bool(group.variant)) for _, variants in by_agent]
    others = _differences(firsts, {*compared, *BUDGET}, ignored_sections=("reward.",))
    if others:
        notes.append(f"Also unequal between agents on {task}: {others}.")
    return notes


def _unseen(groups: Sequence[Group]) -> list[str]:
    """What keeps no runs apart and yet bears on a comparison: other code, other videos, other processors."""
    task, runs = task_title(groups[0].task), [run for group in groups for run in group.runs]
    notes = []
    by_code: dict[str, list[RunFiles]] = {}
    for run in runs:
        by_code.setdefault(run.versions.get("code", "unknown"), []).append(run)
    if len(by_code) > 1:
        told = "; ".join(f"{code}: {paths_of(of_code)}" for code, of_code in by_code.items())
        notes.append(f"Runs on {task} were made by different versions of the library's code ({told}).")
    elif "unknown" in by_code:
        notes.append(
            f"Runs on {task} are older than the record of the library's code, so nothing here tells whether they are "
            "of one version."
        )
    shown = [run for run in runs if run.method not in READ_NO_VIDEOS]
    for behavior in dict.fromkeys(behavior for run in shown for behavior in run.videos):
        found = [run.videos[behavior] for run in shown if behavior in run.videos]
        sets = [f"{each.get('count')} of digest {each.get('digest')}" for each in found]
        if len(set(sets)) > 1:
            notes.append(
                f"Runs on {task} learned from {behavior} videos that were not the same, such as those recorded on "
                f"another machine or at another size: {_counted(sets)}."
            )
    learners = [run for run in runs if run.method not in LEARN_NOTHING and run.time_budget is not None]
    processors = [run.versions.get("processor", "unknown") for run in learners]
    if len(set(processors)) > 1:
        notes.append(
            f"Runs on {task} had their time on different processors, on which it buys more or less: "
            f"{_counted(processors)}."
        )
    return notes


def _counted(values: Sequence[str]) -> str:
    return ", ".join(
        f"{value} ({count} run{'s' if count > 1 else ''})" for value, count in Counter(values).items()
    )


def _differences(
    groups: Sequence[Group], ignored: Collection[str] = (), ignored_sections: tuple[str, ...] = ()
) -> str:
    """The fields in which groups differ, with their values in the order of the groups; empty where they do not."""
    all_terms = [terms(group.runs[0]) for group in groups]
    names = dict.fromkeys(name for each in all_terms for name in each)
    told = []
    for name in names:
        values = [each.get(name, "absent") for each in all_terms]
        if len(set(values)) > 1 and name not in ignored and not name.startswith(ignored_sections):
            told.append(f"{name} ({' / '.join(values)})")
    more = len(told) - SHOWN_DIFFERENCES
    return ", ".join(told[:SHOWN_DIFFERENCES]) + (f" and {more} more" if more > 0 else "")


def _count_of(run: RunFiles, name: str) -> int | None:
    value = dict(flattened(run.config)).get(name, "")
    return int(value) if value.isdecimal() and len(value) < 19 else None
