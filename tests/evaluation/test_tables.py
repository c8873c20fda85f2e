from dataclasses import replace
from pathlib import Path

import pytest

from bootifol.errors import BootifolError
from bootifol.evaluation.tables import (
    EvaluationRow,
    RankingRow,
    append_evaluations,
    append_ranking,
    read_evaluations,
    read_ranking,
)

ROW = EvaluationRow(1000, 12.5, 60, 0, 7, 31.25, 0.1 + 0.2, True)


def test_rows_come_back_exactly(tmp_path: Path) -> None:
    path = tmp_path / "run" / "evaluations.csv"
    rows = [
        ROW,
        replace(ROW, episode=1, success=False),
        replace(ROW, episode=2, scaled_return=None, success=None),
    ]
    append_evaluations(path, rows)
    assert read_evaluations(path).rows == rows
    assert path.read_text().splitlines()[0] == (
        "agent_steps,seconds,episode_steps,episode,seed,environment_return,scaled_return,success"
    )


def test_a_repeated_evaluation_replaces_the_old_one_and_no_other(tmp_path: Path) -> None:
    path = tmp_path / "evaluations.csv"
    long = replace(ROW, episode_steps=500, environment_return=900.0)
    later = replace(ROW, agent_steps=2000)
    append_evaluations(path, [ROW, long])
    append_evaluations(path, [later])
    append_evaluations(path, [replace(ROW, environment_return=1.0)])
    assert read_evaluations(path).rows == [long, replace(ROW, environment_return=1.0), later]


def test_a_cut_line_is_named_and_the_rest_is_read(tmp_path: Path) -> None:
    path = tmp_path / "evaluations.csv"
    append_evaluations(path, [ROW, replace(ROW, episode=1)])
    path.write_text(path.read_text()[:-12])
    table = read_evaluations(path)
    assert table.rows == [ROW]
    assert table.damaged_lines == [3]
    append_evaluations(path, [replace(ROW, agent_steps=5000)])
    assert [row.agent_steps for row in read_evaluations(path).rows] == [1000, 5000]


def test_ranking_names_may_hold_commas(tmp_path: Path) -> None:
    path = tmp_path / "ranking.csv"
    rows = [RankingRow(0, "expert", 'a, "b"', -1.5), RankingRow(0, "random", "c", -3.0)]
    append_ranking(path, rows)
    append_ranking(path, [RankingRow(10, "expert", "d", 2.0)])
    assert read_ranking(path).rows == [*rows, RankingRow(10, "expert", "d", 2.0)]


def test_missing_and_foreign_tables_are_refused_with_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match="is missing: there is no"):
        read_ranking(tmp_path / "ranking.csv")
    (tmp_path / "ranking.csv").write_text("a,b\n1,2\n")
    with pytest.raises(BootifolError, match="first line must be agent_steps,kind,video,reward"):
        append_ranking(tmp_path / "ranking.csv", [RankingRow(0, "expert", "x", 1.0)])
    assert (tmp_path / "ranking.csv").read_text() == "a,b\n1,2\n"
