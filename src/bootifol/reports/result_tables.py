"""The paper's result tables from run directories: scaled and absolute returns beside the paper's own."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from bootifol.errors import BootifolError
from bootifol.evaluation.summary import Summary, summarize
from bootifol.reports.comparison import Comparison, Group, budget, compare, paths_of
from bootifol.reports.final_return import FinalReturn, final_return
from bootifol.reports.names import LEARN_NOTHING, task_title
from bootifol.reports.paper_results import REMARKS, TABLES, PaperReturn
from bootifol.reports.run_files import RunFiles

Measure = Literal["scaled", "absolute"]

DECIMALS: dict[Measure, int] = {"scaled": 2, "absolute": 1}

FEW_SEEDS = 5
"""Up to so many, the mean of every seed is told below the table."""

ENDS = ("Expert", "Random")
"""The ends of the scale: what is above and below all agents in an absolute table."""

HOW_TO_READ = (
    "Mean and interquartile mean (IQM) are over seeds, a seed being the mean of its final episodes; brackets hold "
    "95 % bootstrap intervals. † One seed: mean, IQM and intervals are over its episodes, so they do not say how "
    "much seeds differ. The IQM of fewer than four seeds is their mean, and intervals over few seeds are too narrow."
)
THE_PAPERS = (
    "The paper's column holds its printed numbers: other experts, other versions of the simulators, its own "
    "hyperparameters and 1,550,000 agent steps. ± as printed."
)


@dataclass(frozen=True)
class ResultRow:
    """One agent on one task."""

    task: str
    agent: str
    runs: tuple[RunFiles, ...]
    """The seeds; empty where the row holds the paper's number or an end of the scale alone."""

    episodes: int
    """Final episodes of all seeds."""

    summary: Summary | None
    """Over seeds; with one seed over its episodes. None where nothing was run."""

    seed_means: tuple[float, ...]
    """Of the final episodes of every seed; empty where the summary is None."""

    level: float | None
    """The return of the expert or of the random agent that the runs were scaled with."""

    paper: PaperReturn | None


@dataclass(frozen=True)
class ResultTable:
    """Rows of one kind of return."""

    title: str
    measure: Measure
    rows: Sequence[ResultRow]


@dataclass(frozen=True)
class Results:
    """All tables, and what stands below them."""

    tables: Sequence[ResultTable]
    notes: Sequence[str]
    """One sentence or two each: what to beware of first, then what the rows are made of."""


def result_tables(runs: Sequence[RunFiles], tasks: Collection[str] | None = None) -> Results:
    """The tables of the paper that the runs have a part in, and one of every task beyond the paper.

    Args:
        runs: from `read_runs`.
        tasks: the only ones to show; None for all.

    Raises:
        BootifolError: there is no finished run, or none on one of these tasks.
    """
    found = dict.fromkeys(run.task for run in runs)
    missing = [task for task in tasks or () if task not in found]
    if missing:
        raise BootifolError(
            f"none of the runs is on {', '.join(missing)}; they are on {', '.join(found) or 'no task'}"
        )
    chosen = [run for run in runs if tasks is None or run.task in tasks]
    comparison = compare(chosen)
    if not comparison.groups:
        raise BootifolError("there is no finished run to make a table of: " + " ".join(comparison.notes))
    tables = [*_tables(comparison, "scaled"), *_tables(comparison, "absolute")]
    notes = [*comparison.notes, *_scale_notes(comparison), *_provenance(comparison), HOW_TO_READ, THE_PAPERS]
    notes += [REMARKS[task] for task in comparison.tasks() if task in REMARKS]
    return Results(tables, notes)


def _tables(comparison: Comparison, measure: Measure) -> list[ResultTable]:
    tables = []
    beyond = [task for task in comparison.tasks() if not any(task in table.tasks for table in TABLES)]
    for paper in TABLES:
        rows = [
            row
            for task, returns in paper.tasks.items()
            if comparison.of(task)
            for row in _rows(comparison.of(task), returns, measure)
        ]
        if rows:
            number = paper.scaled_number if measure == "scaled" else paper.absolute_number
            title = f"{paper.suite}, {measure} return (Table {number} of the paper)"
            tables.append(ResultTable(title, measure, rows))
    rows = [row for task in beyond for row in _rows(comparison.of(task), {}, measure)]
    if rows:
        tables.append(ResultTable(f"Beyond the paper, {measure} return", measure, rows))
    return tables


def _rows(groups: Sequence[Group], papers: Mapping[str, PaperReturn], measure: Measure) -> list[ResultRow]:
    """A row for every agent of the paper and every group; the ends of the scale only where returns are absolute."""
    agents = dict.fromkeys([*papers, *(group.agent for group in groups)])
    middle = [agent for agent in agents if agent not in ENDS]
    levels = _levels(groups)
    rows = []
    for agent in (ENDS[0], *middle, ENDS[1]):
        own = [group for group in groups if group.agent == agent]
        paper = papers.get(agent)
        if agent in ENDS and measure == "absolute" and (paper or levels) and not own:
            level = levels[ENDS.index(agent)] if levels else None
            rows.append(ResultRow(groups[0].task, agent, (), 0, None, (), level, paper))
        elif agent in papers and agent not in ENDS and not own:
            rows.append(ResultRow(groups[0].task, agent, (), 0, None, (), None, paper))
        has_usual = any(not group.variant for group in own)
        for group in own:
            finals = finals_of(group)
            episodes = sum(final.environment_return.count for final in finals)
            summary = over_seeds(finals, measure)
            theirs = None if group.variant and has_usual else paper
            means = seed_means(finals, measure)
            rows.append(ResultRow(group.task, group.name, group.runs, episodes, summary, means, None, theirs))
    return rows


def finals_of(group: Group) -> list[FinalReturn]:
    """The final evaluation of every seed."""
    return [final for final in map(final_return, group.runs) if final is not None]


def over_seeds(finals: Sequence[FinalReturn], measure: Measure) -> Summary | None:
    """Summary of the seeds' means, or of the episodes of a single seed; None where a return is not scaled."""
    summaries = _of_seeds(finals, measure)
    if len(summaries) < 2:
        return summaries[0] if summaries else None
    return summarize([summary.mean for summary in summaries])


def seed_means(finals: Sequence[FinalReturn], measure: Measure) -> tuple[float, ...]:
    """The mean of every seed; empty where a return is not scaled."""
    return tuple(summary.mean for summary in _of_seeds(finals, measure))


def _of_seeds(finals: Sequence[FinalReturn], measure: Measure) -> list[Summary]:
    """The summary of every seed's episodes; none where a return is not scaled."""
    found = [final.environment_return if measure == "absolute" else final.scaled_return for final in finals]
    summaries = [summary for summary in found if summary is not None]
    return summaries if len(summaries) == len(found) else []


def _levels(groups: Sequence[Group]) -> tuple[float, float] | None:
    """Returns of the expert and of the random agent on the scale of the first run that shows them."""
    for group in groups:
        for run, final in zip(group.runs, finals_of(group), strict=True):
            levels = run.return_levels(final.episode_steps)
            if levels is not None:
                return levels[1], levels[0]
    return None


def _scale_notes(comparison: Comparison) -> list[str]:
    """Tasks whose returns have no scale, or more than one."""
    notes = []
    for task in comparison.tasks():
        scales: dict[str, list[str]] = {}
        for group in comparison.of(task):
            for run, final in zip(group.runs, finals_of(group), strict=True):
                levels = run.return_levels(final.episode_steps)
                if final.scaled_return is None:
                    scales.setdefault("no scale", []).append(str(run.path))
                elif levels is not None:
                    random, expert = (round(level, 1) + 0.0 for level in levels)
                    told = f"random {random} and expert {expert}"
                    scales.setdefault(told, []).append(str(run.path))
        if list(scales) == ["no scale"]:
            notes.append(
                f"{task_title(task)} has no scaled returns: its expert's or random return was not measured."
            )
        elif len(scales) > 1:
            told = "; ".join(f"{scale}: {', '.join(paths)}" for scale, paths in scales.items())
            notes.append(f"Returns on {task_title(task)} are scaled in more than one way ({told}).")
    return notes


def fixed_number(value: float, measure: Measure) -> str:
    """A return with the digits of its tables, and a real minus sign."""
    # Adding 0 turns a rounded -0 into 0.
    rounded = round(value, DECIMALS[measure]) + 0.0
    return f"{rounded:.{DECIMALS[measure]}f}".replace("-", "\N{MINUS SIGN}")


def _told_seeds(group: Group) -> str:
    """Such as `seeds 1, 2 with scaled means 0.78, 0.89`; the means where there are few seeds, but more than one."""
    finals = finals_of(group)
    if not 1 < len(finals) <= FEW_SEEDS:
        return group.seeds
    measure: Measure = "scaled" if seed_means(finals, "scaled") else "absolute"
    means = ", ".join(fixed_number(mean, measure) for mean in seed_means(finals, measure))
    return f"{group.seeds} with {measure} means {means}"


def _provenance(comparison: Comparison) -> list[str]:
    """What each row is made of."""
    notes = []
    for group in comparison.groups:
        steps = sorted({run.agent_steps for run in group.runs})
        presets = ", ".join(dict.fromkeys(run.preset for run in group.runs))
        made_of = f"{_told_seeds(group)} ({paths_of(group.runs)}), preset {presets}"
        told = f"{group.name} on {task_title(group.task)}: {made_of}"
        if group.runs[0].method not in LEARN_NOTHING:
            trained = " to ".join(f"{count:,}" for count in dict.fromkeys((steps[0], steps[-1])))
            told += f", budget {budget(group.runs[0])}, trained for {trained} agent steps"
        notes.append(f"{told}.")
    return notes
