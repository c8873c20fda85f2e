"""Result tables as Markdown, LaTeX and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.reports.collection import read_runs
from bootifol.reports.markdown import markdown_table
from bootifol.reports.names import task_title
from bootifol.reports.result_tables import (
    Measure,
    ResultRow,
    Results,
    ResultTable,
    fixed_number,
    result_tables,
)
from bootifol.types import AnyPath

HEADER = ("Task", "Agent", "Seeds", "Episodes", "Mean [95 %]", "IQM [95 %]", "Paper")

CSV_HEADER = (
    *("table", "measure", "task", "agent", "seeds", "episodes", "mean", "mean_low", "mean_high"),
    *("interquartile_mean", "interquartile_mean_low", "interquartile_mean_high", "intervals_over"),
    *("seed_means", "paper", "paper_deviation", "runs", "note"),
)

NOTHING = "–"
"""Where nothing was run, or the paper has no number."""


def table(paths: Sequence[AnyPath], out: AnyPath | None = None, tasks: Collection[str] | None = None) -> str:
    """The paper's result tables from runs, as Markdown; written to a file on request.

    Args:
        paths: run directories, collections of results, or directories that hold some.
        out: a file to write, as its name ends: .md, .tex or .csv.
        tasks: the only ones to show; None for all.

    Returns:
        The tables and the notes below them as Markdown, whatever was written.

    Raises:
        BootifolError: no finished run was given, or the file's name ends otherwise.
    """
    target = None if out is None else Path(out)
    if target is not None and target.suffix not in FORMATS:
        raise BootifolError(
            f"{target} is no name for a table: it must end in {', '.join(FORMATS)}, for Markdown, LaTeX or CSV"
        )
    results = result_tables(read_runs([Path(path) for path in paths]), tasks)
    if target is not None:
        with written_aside(target) as aside:
            aside.write_text(FORMATS[target.suffix](results))
    return markdown(results)


def markdown(results: Results) -> str:
    """Tables with aligned columns, and the notes as a list."""
    parts = []
    for each in results.tables:
        lines = [HEADER, *_lines(each)]
        widths = [max(len(line[column]) for line in lines) for column in range(len(HEADER))]
        header, *rows = [_aligned(line, widths) for line in lines]
        rule = ["-" * width if column < 2 else "-" * (width - 1) + ":" for column, width in enumerate(widths)]
        parts.append(f"**{each.title}**\n\n{markdown_table(header, rows, rule)}")
    parts.append("\n".join(f"- {note}" for note in results.notes))
    return "\n\n".join(parts) + "\n"


def latex(results: Results) -> str:
    """Tables for the package booktabs, and the notes as a list."""
    parts = ["% Needs \\usepackage{booktabs}."]
    for each in results.tables:
        rows = [" & ".join(_escaped(text) for text in line) + r" \\" for line in [HEADER, *_lines(each)]]
        parts.append(
            "\n".join(
                [
                    r"\begin{table}",
                    r"\centering",
                    rf"\caption{{{_escaped(each.title)}}}",
                    rf"\begin{{tabular}}{{ll{'r' * (len(HEADER) - 2)}}}",
                    r"\toprule",
                    rows[0],
                    r"\midrule",
                    *rows[1:],
                    r"\bottomrule",
                    r"\end{tabular}",
                    r"\end{table}",
                ]
            )
        )
    notes = [rf"\item {_escaped(note)}" for note in results.notes]
    parts.append("\n".join([r"\begin{itemize}", r"\footnotesize", *notes, r"\end{itemize}"]))
    return "\n\n".join(parts) + "\n"


def comma_separated(results: Results) -> str:
    """One line a row with all digits, then one line a note, which has nothing but the note."""
    text = io.StringIO()
    writer = csv.DictWriter(text, CSV_HEADER, lineterminator="\n")
    writer.writeheader()
    for each in results.tables:
        for row in each.rows:
            writer.writerow({"table": each.title, "measure": each.measure, **_record(row, each.measure)})
    for note in results.notes:
        writer.writerow({"note": note})
    return text.getvalue()


FORMATS: dict[str, Callable[[Results], str]] = {".md": markdown, ".tex": latex, ".csv": comma_separated}
"""How a table is written, by the ending of the file's name."""


def _lines(of: ResultTable) -> list[tuple[str, ...]]:
    """The cells of every row as text; a task is named in its first row."""
    lines, before = [], ""
    for row in of.rows:
        lines.append(("" if row.task == before else task_title(row.task), *_cells(row, of.measure)))
        before = row.task
    return lines


def _cells(row: ResultRow, measure: Measure) -> tuple[str, ...]:
    """Agent, seeds, episodes, mean, interquartile mean, the paper's number."""
    paper = _paper(row, measure)
    if row.summary is None:
        level = NOTHING if row.level is None else fixed_number(row.level, measure)
        return row.agent, _count(len(row.runs)), _count(row.episodes), level, NOTHING, paper
    mark = " †" if len(row.runs) == 1 else ""
    mean = _with_interval(row.summary.mean, row.summary.interval, measure)
    middle = _with_interval(row.summary.interquartile_mean, row.summary.interquartile_interval, measure)
    return row.agent, _count(len(row.runs)), _count(row.episodes), mean + mark, middle + mark, paper


def _paper(row: ResultRow, measure: Measure) -> str:
    if row.paper is None or (measure == "scaled" and row.paper.scaled is None):
        return NOTHING
    if row.paper.scaled is not None and measure == "scaled":
        return fixed_number(row.paper.scaled, measure)
    # With the digits that the paper prints.
    return f"{row.paper.absolute:.2f} ± {row.paper.deviation:.2f}"


def _count(count: int) -> str:
    return str(count) if count else NOTHING


def _with_interval(value: float, interval: tuple[float, float] | None, measure: Measure) -> str:
    if interval is None:
        return fixed_number(value, measure)
    low, high = interval
    return f"{fixed_number(value, measure)} [{fixed_number(low, measure)}, {fixed_number(high, measure)}]"


def _record(row: ResultRow, measure: Measure) -> dict[str, object]:
    """A row for CSV; what is not known is left empty."""
    record: dict[str, object] = {
        "task": row.task,
        "agent": row.agent,
        "seeds": " ".join(str(run.seed) for run in row.runs),
        "episodes": row.episodes,
        "mean": row.level,
        "runs": " ".join(str(run.path) for run in row.runs),
    }
    if row.summary is not None:
        low, high = row.summary.interval or (None, None)
        middle_low, middle_high = row.summary.interquartile_interval or (None, None)
        record |= {
            "mean": row.summary.mean,
            "mean_low": low,
            "mean_high": high,
            "interquartile_mean": row.summary.interquartile_mean,
            "interquartile_mean_low": middle_low,
            "interquartile_mean_high": middle_high,
            "intervals_over": "seeds" if len(row.runs) > 1 else "episodes",
            "seed_means": " ".join(str(mean) for mean in row.seed_means),
        }
    if row.paper is not None:
        record["paper"] = row.paper.scaled if measure == "scaled" else row.paper.absolute
        record["paper_deviation"] = None if measure == "scaled" else row.paper.deviation
    return record


def _aligned(line: Sequence[str], widths: Sequence[int]) -> list[str]:
    """Names to the left, numbers to the right."""
    return [
        text.ljust(width) if column < 2 else text.rjust(width)
        for column, (text, width) in enumerate(zip(line, widths, strict=True))
    ]


def _escaped(text: str) -> str:
    """Text for LaTeX."""
    return text.translate(_LATEX)


_LATEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        **{sign: f"\\{sign}" for sign in "#$%&_{}"},
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "\N{MINUS SIGN}": "$-$",
        "–": "--",
        "±": r"$\pm$",
        "†": r"$^\dagger$",
        "…": r"\dots{}",
    }
)
