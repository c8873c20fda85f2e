"""What a sweep shows."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console
from tiny_sweeps import RUN

from bootifol.sweep.beside import Place
from bootifol.sweep.planned import RANDOM, PlannedRun
from bootifol.sweep.progress import Board, Job, seconds_left
from bootifol.sweep.run_state import RunState

HERE = Place("node7", "abc", 1, resumed=False)


def job(run: PlannedRun, state: RunState, pending: bool = True, place: Place | None = None) -> Job:
    return Job(run, Path("out") / run.name, state, place, pending)


def jobs() -> list[Job]:
    second = replace(RUN, seed=2)
    return [
        job(RUN, RunState("done", 60, 240, 100.0), pending=False),
        job(replace(RUN, method="virl"), RunState("failed", 0, 120, 50.0, "the loss is nan"), pending=False),
        job(second, RunState("begun", 60, 60, 30.0), place=HERE),
        job(replace(second, method="virl"), RunState("begun")),
        job(replace(second, method=RANDOM), RunState("begun")),
    ]


def test_the_time_left_is_that_of_runs_alike() -> None:
    # The second bootifol goes on as it went: 30 s for a quarter. The second virl takes as long as the first would have.
    assert seconds_left(jobs(), at_once=1) == pytest.approx((120 - 30) + 100)
    assert seconds_left(jobs(), at_once=2) == pytest.approx(190 / 2)
    assert seconds_left([job(RUN, RunState("begun"))], at_once=1) is None


def test_with_a_time_budget_the_time_left_is_known_at_once() -> None:
    timed = replace(RUN, time_budget="60s")
    waiting = [job(timed, RunState("begun")), job(timed, RunState("begun", 5, 0, 15.0), place=HERE)]
    assert seconds_left(waiting, at_once=1) == pytest.approx(60 + 45)
    assert waiting[1].fraction == pytest.approx(0.25)


def test_the_table_shows_what_goes_on_first() -> None:
    console = Console(file=io.StringIO(), width=160, height=10, force_terminal=True, color_system=None)
    board = Board(jobs(), console)
    console.print(board.table())
    rows = [line.split() for line in console.file.getvalue().splitlines()]  # type: ignore[attr-defined]
    assert rows[1] == [
        "drawn_home/bootifol/seed2",
        "running",
        "25%",
        "60",
        "agent",
        "steps,",
        "30",
        "s",
        "node7",
    ]
    assert rows[2][:2] == ["drawn_home/virl/seed1", "failed"] and " ".join(rows[2]).endswith(
        "the loss is nan"
    )
    assert rows[3][:2] == ["drawn_home/virl/seed2", "waiting"]
    summary = "1 running, 1 failed, 2 waiting, 1 done, about 3 min 10 s left"
    assert " ".join(rows[4]) == summary, (
        "a table that fits the terminal's height, and what is beyond it in words"
    )


def test_without_a_terminal_there_is_a_line_at_changes() -> None:
    console = Console(file=io.StringIO(), width=40)
    board = Board(jobs(), console)
    with board.shown():
        board.update()
        board.say(board.jobs[2], "begun", "on node7")
    assert console.file.getvalue() == (  # type: ignore[attr-defined]
        "begun      drawn_home/bootifol/seed2: on node7; 1 running, 1 failed, 2 waiting, 1 done, "
        "about 3 min 10 s left\n"
    )
