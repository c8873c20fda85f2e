"""The report: one HTML file that holds everything it shows and asks the network for nothing."""

from __future__ import annotations

import base64
import hashlib
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from bootifol.evaluation.sight import against_kinds
from bootifol.evaluation.summary import Summary
from bootifol.files import written_aside
from bootifol.progress import duration
from bootifol.reports import plots
from bootifol.reports.collection import read_runs
from bootifol.reports.comparison import compare
from bootifol.reports.film_strip import SHOWN_KINDS, reward_above_film_strip, videos_of_start
from bootifol.reports.final_return import FinalReturn, final_return
from bootifol.reports.findings import Finding, findings, scores_or_none
from bootifol.reports.names import task_title
from bootifol.reports.plots import RunLook, common_length, looks_of
from bootifol.reports.result_tables import fixed_number
from bootifol.reports.run_files import COUNTERS, RunFiles, flattened
from bootifol.reports.style import KIND_COLORS, short_number, svg_data_uri, thousands
from bootifol.rewards.config import CAPTIONS
from bootifol.types import AnyPath

SHOWN_STARTS = 4
"""Starts shown with pictures and videos; more would make the file heavy and tell little."""


@dataclass(frozen=True)
class Card:
    """A figure, its title, and one line on how to read it and what healthy looks like."""

    title: str
    image: str
    """Data URI."""

    caption: str


@dataclass(frozen=True)
class Tile:
    """One number of the headline."""

    name: str
    value: str
    detail: str


@dataclass(frozen=True)
class PlayedVideo:
    """An mp4 that plays in the page."""

    kind: str
    color: str
    source: str
    """Data URI."""

    detail: str


@dataclass(frozen=True)
class RunSection:
    """Everything the report says about one run."""

    run: RunFiles
    anchor: str
    name: str
    color: str
    tiles: Sequence[Tile]
    findings: Sequence[Finding]
    videos: Sequence[Sequence[PlayedVideo]]
    """Expert and agent of each start."""

    strips: Sequence[Card]
    curves: Sequence[Card]
    sight: Sequence[Card]
    ranking: Sequence[Card]
    losses: Sequence[Card]
    other_metrics: Sequence[Card]
    config: Sequence[tuple[str, str]]


def report(run_dirs: Sequence[AnyPath], out: AnyPath) -> Path:
    """Writes the report of one run, or of several side by side, and returns its path.

    Args:
        run_dirs: directories that `train` wrote, of finished runs or runs in progress, or directories that hold some.
        out: the HTML file.

    Raises:
        BootifolError: there is no run, or a directory is not one.
    """
    directories, target = [Path(run_dir) for run_dir in run_dirs], Path(out)
    runs = read_runs(directories)
    looks = looks_of(runs)
    page = _template_environment().get_template("page.html")
    html = page.render(
        title=_title(runs),
        sections=[_section(look, f"run-{number}", alone=len(runs) == 1) for number, look in enumerate(looks)],
        comparison=_curve_cards(looks) + _loss_cards(looks) if len(runs) > 1 else [],
        warnings=_warnings(looks) if len(runs) > 1 else [],
        several_tasks=len({run.task for run in runs}) > 1,
        report_command=shlex.join(["bootifol", "report", *map(str, directories), "--out", str(target)]),
        kind_colors=KIND_COLORS,
    )
    with written_aside(target) as aside:
        aside.write_text(html)
    return target


def _template_environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("bootifol.reports", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["csp_source"] = _csp_source
    return environment


def _csp_source(script: str) -> Markup:
    """How the page's content security policy names its own script, the only one that may run."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    return Markup(f"'sha256-{digest}'")


def _title(runs: Sequence[RunFiles]) -> str:
    return ", ".join(dict.fromkeys(task_title(run.task) for run in runs))


def _warnings(looks: Sequence[RunLook]) -> list[str]:
    """What to know before numbers of several runs are compared."""
    runs = [look.run for look in looks]
    notes = list(compare(runs, unfinished=True).notes)
    if common_length(looks) is None:
        lengths = [" and ".join(map(str, run.episode_lengths())) for run in runs]
        played = [
            f"{task_title(run.task)} in {length} agent steps"
            for run, length in zip(runs, lengths, strict=True)
            if length
        ]
        told = "; ".join(dict.fromkeys(played)) or "no evaluations yet"
        notes.insert(
            0, f"Only scaled returns are drawn together, for these runs share no other measure ({told})."
        )
    return notes


def _section(look: RunLook, anchor: str, alone: bool) -> RunSection:
    run = look.run
    single = looks_of([run])
    return RunSection(
        run=run,
        anchor=anchor,
        name=look.name,
        color=look.color,
        tiles=_tiles(run),
        findings=findings(run),
        videos=_video_rows(run),
        strips=_strip_cards(run),
        curves=_curve_cards(single),
        sight=_sight_cards(run),
        ranking=_ranking_cards(run),
        losses=_loss_cards(single) if alone else [],
        other_metrics=_other_cards(single),
        config=list(flattened(run.config)),
    )


def _tiles(run: RunFiles) -> list[Tile]:
    final = final_return(run)
    tiles = [] if final is None else _return_tiles(run, final)
    tiles.append(Tile("Agent steps", thousands(run.agent_steps), f"{run.agent_steps:,} actions"))
    if run.seconds is not None:
        tiles.append(Tile("Wall-clock time", duration(run.seconds), f"preset {run.preset}"))
    return tiles


def _return_tiles(run: RunFiles, final: FinalReturn) -> list[Tile]:
    episodes = f"{final.environment_return.count} episodes of {final.episode_steps} agent steps"
    levels = run.return_levels(final.episode_steps)
    against = (
        episodes
        if levels is None
        else f"in {final.episode_steps} agent steps; random {short_number(levels[0])}, expert "
        f"{short_number(levels[1])}"
    )
    tiles = []
    if final.scaled_return is not None:
        scaled = final.scaled_return
        tiles.append(
            Tile("Scaled return", fixed_number(scaled.mean, "scaled"), f"{_interval(scaled)}{episodes}")
        )
    tiles.append(Tile("Return", short_number(final.environment_return.mean), against))
    return tiles


def _interval(summary: Summary) -> str:
    if summary.interval is None:
        return ""
    low, high = (fixed_number(end, "scaled") for end in summary.interval)
    return f"95% interval {low} to {high}, "


def _curve_cards(looks: Sequence[RunLook]) -> list[Card]:
    alone = len(looks) == 1
    band = "Line: mean of the episodes; band: 95% bootstrap interval" + (
        "; dots: single episodes. " if alone else ". "
    )
    return [
        *_card(
            "Scaled return",
            plots.return_curves(looks, scaled=True),
            f"{band}0 is random, 1 the expert. Healthy: climbs toward 1 and stays there.",
        ),
        *_card(
            "Return",
            plots.return_curves(looks, scaled=False),
            f"{band}The environment's own reward; only the method environment learns from it. Healthy: rises.",
        ),
        *_card(
            "Scaled return by wall-clock time",
            plots.return_curves(looks, scaled=True, by_time=True),
            "As the first curve, by time, alignment included: for comparing methods at equal cost.",
        ),
        *_card(
            "Learned reward",
            plots.learned_reward_curves(looks),
            "What the agent earned per step of its training episodes"
            + ("" if alone else ", on a scale of each run's own")
            + ". Healthy: rises together with the return; rising alone, it is being tricked.",
        ),
    ]


def _loss_cards(looks: Sequence[RunLook]) -> list[Card]:
    return [
        card
        for name, (title, caption) in CAPTIONS.items()
        for card in _card(title, plots.loss_curves(looks, name), caption)
    ]


def _sight_cards(run: RunFiles) -> list[Card]:
    moments = run.sight_moments()
    if not any(against_kinds(figures) for figures in moments.values()):
        return []
    return _card(
        "The expert against those who fail plausibly",
        plots.sight_plot(moments),
        "Hollow: before the agent acted. Full: at the end. At the line a coin would do as well; healthy: 0.95 or "
        "more. A kind stands here if it failed in a quarter of its episodes at least.",
    )


def _ranking_cards(run: RunFiles) -> list[Card]:
    moments = run.ranking_moments()
    chosen = list(dict.fromkeys([*list(moments)[:1], *list(moments)[-1:]]))
    cards = []
    for agent_steps in chosen:
        scores = scores_or_none(moments[agent_steps])
        when = "Before the agent acted" if agent_steps == 0 else f"After {thousands(agent_steps)} agent steps"
        numbers = (
            ""
            if scores is None
            else f"Kendall's τ {scores.kendall_tau:.2f} (a perfect order gives {scores.perfect_tau:.2f}); "
            f"AUC expert over half-good {scores.expert_above_half_good:.2f}, "
            f"half-good over random {scores.half_good_above_random:.2f}; "
            f"margins {scores.expert_margin:.1f} and {scores.half_good_margin:.1f} standard deviations. "
        )
        cards += _card(
            when,
            plots.ranking_plot(moments[agent_steps]),
            f"{numbers}A dot is one video the reward model never trained on. "
            + (
                "Healthy: your videos (expert) right of random."
                if scores is None
                else "Healthy: expert right of half-good, half-good right of random."
            ),
        )
    return cards


def _other_cards(looks: Sequence[RunLook]) -> list[Card]:
    shown = {"episode/learned_reward", *CAPTIONS}
    cards = []
    for phase, name in sorted(looks[0].run.curves):
        if name not in shown and not name.startswith("sight/"):
            unit = COUNTERS[phase].replace("_", " ") + ("" if COUNTERS[phase].endswith("s") else "s")
            caption = f"{phase.title()} Phase, over {unit}; band: the middle 80% of nearby values."
            cards += _card(name, plots.metric_curves(looks, phase, name), caption)
    return cards


def _strip_cards(run: RunFiles) -> list[Card]:
    cards = []
    for start in run.starts()[:SHOWN_STARTS]:
        videos = videos_of_start(run, start)
        if videos:
            cards += _card(
                f"Start {start + 1}",
                reward_above_film_strip(videos),
                "Each picture stands below its moment on the curve. Healthy: "
                + (
                    "the expert's reward stays above random's, and the agent's curve and pictures follow the expert's."
                    if "expert" in videos
                    else "the agent's reward stays above random's, and its pictures show what your videos show."
                ),
            )
    return cards


def _card(title: str, figure: Figure | None, caption: str) -> list[Card]:
    """One card, or none where there was nothing to draw."""
    return [] if figure is None else [Card(title, svg_data_uri(figure), caption)]


def _video_rows(run: RunFiles) -> list[list[PlayedVideo]]:
    rows = []
    # Random actions are shown only where there is no expert to compare with.
    expert = any(kind == "expert" for kind, _ in run.video_files)
    for start in sorted({start for _, start in run.video_files})[:SHOWN_STARTS]:
        row = []
        for kind in (kind for kind in SHOWN_KINDS if kind != "random" or not expert):
            path = run.video_files.get((kind, start))
            if path is None:
                continue
            shown = run.showcase.get((kind, start))
            detail = ""
            if shown is not None and shown.environment_return is not None:
                detail = (
                    f"return {short_number(shown.environment_return)} in {len(shown.rewards)} agent steps"
                )
            row.append(
                PlayedVideo(
                    kind=kind,
                    color=KIND_COLORS[kind],
                    source="data:video/mp4;base64," + base64.b64encode(path.read_bytes()).decode("ascii"),
                    detail=detail,
                )
            )
        rows.append(row)
    return [row for row in rows if row]
