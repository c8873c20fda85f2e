import csv
from pathlib import Path

import pytest
from made_up_runs import write_run

from bootifol.cli.main import main
from bootifol.errors import BootifolError
from bootifol.reports.markdown import markdown_table
from bootifol.reports.paper_results import TABLES
from bootifol.reports.result_tables import ResultRow, Results, result_tables
from bootifol.reports.run_files import find_runs, read_run
from bootifol.reports.table_files import table


def results_of(root: Path) -> Results:
    return result_tables([read_run(run_dir) for run_dir in find_runs([root])])


def rows_of(results: Results, measure: str) -> dict[str, ResultRow]:
    (chosen,) = [each for each in results.tables if each.measure == measure]
    return {row.agent: row for row in chosen.rows}


def test_four_seeds_are_averaged_over_their_means(tmp_path: Path) -> None:
    for seed, returns in enumerate([(0.0, 0.0), (0.0, 20.0), (15.0, 25.0), (80.0, 100.0)], start=1):
        write_run(tmp_path / f"seed{seed}", returns, seed=seed)
    row = rows_of(results_of(tmp_path), "absolute")["BootIfOL"]
    assert row.summary is not None
    # The seeds' means are 0, 10, 20 and 90: (0 + 10 + 20 + 90) / 4, and (10 + 20) / 2 in the middle.
    assert row.summary.mean == pytest.approx(30.0)
    assert row.summary.interquartile_mean == pytest.approx(15.0)
    assert (row.summary.count, len(row.runs), row.episodes) == (4, 4, 8)
    low, high = row.summary.interval or (0.0, 0.0)
    assert 0.0 <= low < 30.0 < high <= 90.0
    scaled = rows_of(results_of(tmp_path), "scaled")["BootIfOL"].summary
    assert scaled is not None
    assert scaled.mean == pytest.approx(0.30)


def test_few_seeds_are_told_one_by_one(tmp_path: Path) -> None:
    for seed, returns in enumerate([(50.0, 70.0), (-10.0, 8.0), (80.0, 100.0)], start=1):
        write_run(tmp_path / f"virl{seed}", returns, seed=seed, method="virl")
        write_run(tmp_path / f"walker{seed}", returns, seed=seed, task="walker_run", levels=None)
    for seed in range(1, 7):
        write_run(tmp_path / f"six{seed}", seed=seed)
    write_run(tmp_path / "one", method="gaifo")
    notes = "\n".join(results_of(tmp_path).notes)
    assert "ViRL on Reacher Hard: seeds 1, 2, 3 with scaled means 0.60, −0.01, 0.90 (" in notes
    assert "BootIfOL on Walker Run: seeds 1, 2, 3 with absolute means 60.0, −1.0, 90.0 (" in notes
    assert "BootIfOL on Reacher Hard: seeds 1, 2, 3, 4, 5, 6 (" in notes
    assert "GAIfO on Reacher Hard: seed 1 (" in notes


def test_a_single_seed_is_summarized_over_its_episodes(tmp_path: Path) -> None:
    write_run(tmp_path / "a", (0.0, 0.0, 10.0, 20.0, 30.0, 40.0, 100.0, 1000.0))
    row = rows_of(results_of(tmp_path), "absolute")["BootIfOL"]
    assert row.summary is not None
    # A sum of 1200 over 8 episodes, and 10, 20, 30 and 40 in the middle.
    assert row.summary.mean == pytest.approx(150.0)
    assert row.summary.interquartile_mean == pytest.approx(25.0)
    assert (len(row.runs), row.episodes) == (1, 8)


def test_the_paper_stands_beside_and_what_was_not_run_is_shown(tmp_path: Path) -> None:
    write_run(tmp_path / "a")
    write_run(tmp_path / "b", method="gaifo")
    scaled, absolute = (rows_of(results_of(tmp_path), measure) for measure in ("scaled", "absolute"))
    assert list(scaled) == ["BootIfOL", "ViRL", "CT (n=10)", "CT (n=1)", "GAIfO"]
    assert list(absolute) == ["Expert", "BootIfOL", "ViRL", "CT (n=10)", "CT (n=1)", "GAIfO", "Random"]
    assert scaled["BootIfOL"].paper is not None
    assert scaled["BootIfOL"].paper.scaled == 0.99
    assert scaled["ViRL"].summary is None
    assert scaled["GAIfO"].paper is None
    assert (absolute["Expert"].level, absolute["Random"].level) == (pytest.approx(100.0), pytest.approx(0.0))


def test_a_random_policy_that_was_played_has_the_last_row(tmp_path: Path) -> None:
    write_run(tmp_path / "a", (1.0, 3.0), method="random", agent_steps=0)
    write_run(tmp_path / "b")
    results = results_of(tmp_path)
    row = list(rows_of(results, "absolute").values())[-1]
    assert row.agent == "Random"
    assert row.summary is not None
    assert row.summary.mean == pytest.approx(2.0)
    assert row.paper is not None
    assert row.paper.absolute == 6.64
    assert list(rows_of(results, "scaled"))[-1] == "Random"


def test_each_suite_has_the_papers_table_and_other_tasks_their_own(tmp_path: Path) -> None:
    for task in ("drawn_home", "drawer_close", "reacher_hard"):
        write_run(tmp_path / task, task=task)
    titles = [each.title for each in results_of(tmp_path).tables]
    assert titles == [
        "DeepMind Control, scaled return (Table 1 of the paper)",
        "Meta-World, scaled return (Table 2 of the paper)",
        "Beyond the paper, scaled return",
        "DeepMind Control, absolute return (Table 5 of the paper)",
        "Meta-World, absolute return (Table 6 of the paper)",
        "Beyond the paper, absolute return",
    ]


def test_the_papers_scaled_returns_follow_from_its_absolute_ones() -> None:
    """Guards the typing; the paper clips at 0, cuts digits, and disagrees with itself on Drawer Close."""
    checked = 0
    for task, returns in ((t, r) for paper in TABLES for t, r in paper.tasks.items() if t != "drawer_close"):
        random, expert = returns["Random"].absolute, returns["Expert"].absolute
        for agent in returns.values():
            if agent.scaled is not None:
                follows = max((agent.absolute - random) / (expert - random), 0.0)
                assert follows == pytest.approx(agent.scaled, abs=0.011), task
                checked += 1
    assert checked == 20


def test_a_task_without_a_scale_is_named(tmp_path: Path) -> None:
    write_run(tmp_path / "a", task="walker_run", levels=None)
    results = results_of(tmp_path)
    assert rows_of(results, "scaled")["BootIfOL"].summary is None
    assert any(note.startswith("Walker Run has no scaled returns") for note in results.notes)


def test_scales_that_differ_are_named(tmp_path: Path) -> None:
    write_run(tmp_path / "a", seed=1)
    write_run(tmp_path / "b", seed=2, levels={"random": 0.0, "expert": 200.0})
    (note,) = [note for note in results_of(tmp_path).notes if "scaled in more than one way" in note]
    assert f"random 0.0 and expert 200.0: {tmp_path / 'b'}" in note


def test_no_finished_run_is_an_error_that_says_why(tmp_path: Path) -> None:
    write_run(tmp_path / "a", agent_steps=10)
    with pytest.raises(BootifolError, match=r"no finished run to make a table of: .*10 of 1,000 agent steps"):
        results_of(tmp_path)


def test_a_markdown_table() -> None:
    assert markdown_table(["a", "b"], [["1", "2"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"
    assert markdown_table("ab", [], ["-", "-:"]) == "| a | b |\n| - | -: |"


def test_markdown_shows_numbers_notes_and_the_dagger_of_a_single_seed(tmp_path: Path) -> None:
    write_run(tmp_path / "a", (50.0, 50.0))
    write_run(tmp_path / "cut", agent_steps=10, seed=2)
    printed = table([tmp_path])
    lines = [[cell.strip() for cell in line.split("|")] for line in printed.splitlines()]
    assert ["", "Reacher Hard", "BootIfOL", "1", "2", *["0.50 [0.50, 0.50] †"] * 2, "0.99", ""] in lines
    assert ["", "", "ViRL", "–", "–", "–", "–", "0.00", ""] in lines
    assert ["", "Reacher Hard", "Expert", "–", "–", "–", "–", "850.52 ± 315.70", ""] in lines
    assert f"- {tmp_path / 'cut'} (BootIfOL on Reacher Hard) is unfinished and left out" in printed


def test_a_table_may_be_of_some_tasks_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, task in (("a", "reacher_hard"), ("b", "drawn_home"), ("c", "button_press")):
        write_run(tmp_path / name, task=task)
    assert main(["table", str(tmp_path), "--tasks", "reacher_hard", "drawn_home"]) == 0
    printed = capsys.readouterr().out
    assert "Table 5 of the paper" in printed and "Drawn Home" in printed
    assert "Table 6 of the paper" not in printed and "Button Press" not in printed
    assert main(["table", str(tmp_path), "--tasks", "reacher_hard", "hoper_stand"]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "none of the runs is on hoper_stand; they are on reacher_hard, drawn_home, button_press" in told


def test_latex_is_balanced_and_escaped(tmp_path: Path) -> None:
    write_run(tmp_path / "my_runs" / "50%")
    table([tmp_path], tmp_path / "table.tex")
    written = (tmp_path / "table.tex").read_text()
    assert written.count(r"\begin{tabular}") == written.count(r"\end{tabular}") == 2
    assert r"my\_runs/50\%" in written
    assert not set("–±†−") & set(written)
    rows = [line for line in written.splitlines() if line.endswith(r" \\")]
    assert {line.count(" & ") for line in rows} == {6}


def test_csv_has_all_digits_and_every_note(tmp_path: Path) -> None:
    write_run(tmp_path / "a", (1 / 3, 2 / 3), seed=1)
    write_run(tmp_path / "b", (1.0, 2.0), seed=2)
    write_run(tmp_path / "cut", agent_steps=10, seed=3)
    table([tmp_path], tmp_path / "table.csv")
    records = list(csv.DictReader((tmp_path / "table.csv").open()))
    (own,) = [r for r in records if r["agent"] == "BootIfOL" and r["measure"] == "absolute"]
    assert float(own["mean"]) == pytest.approx(1.0)
    assert float(own["mean_low"]) == pytest.approx(0.5)
    assert (own["seeds"], own["episodes"], own["intervals_over"]) == ("1 2", "4", "seeds")
    assert [float(mean) for mean in own["seed_means"].split()] == pytest.approx([0.5, 1.5])
    (paper,) = [r for r in records if r["agent"] == "ViRL" and r["measure"] == "absolute"]
    assert paper["seed_means"] == ""
    assert (own["paper"], own["paper_deviation"]) == ("843.16", "274.84")
    assert any(str(tmp_path / "cut") in r["note"] and not r["task"] for r in records)


def test_the_command_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_run(tmp_path / "runs" / "a")
    assert main(["table", str(tmp_path / "runs"), "--out", str(tmp_path / "docs" / "table.md")]) == 0
    printed = capsys.readouterr().out
    assert (tmp_path / "docs" / "table.md").read_text() in printed
    assert printed.startswith("**DeepMind Control, scaled return")


def test_another_ending_is_refused_before_anything_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["table", str(tmp_path / "none"), "--out", str(tmp_path / "table.xlsx")]) == 2
    assert "must end in .md, .tex, .csv" in capsys.readouterr().err.replace("\n", " ")
    assert not list(tmp_path.iterdir())
