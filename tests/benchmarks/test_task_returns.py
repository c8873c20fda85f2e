from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.rows import read_rows
from benchmarks.task_returns import COLUMNS, main, measurements, report

from benchmarks import task_returns
from bootifol.tasks import TASKS


def read(path: Path) -> dict[tuple[str, str, str], dict[str, str]]:
    return {(row["task"], row["who"], row["episode_steps"]): row for row in read_rows(path, COLUMNS)}


def test_expert_half_good_and_random_in_their_order(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "returns.csv"
    main(["--tasks", "drawn_home", "--episodes", "6", "--out", str(out)])
    rows = read(out)
    assert list(rows) == [
        ("drawn_home", "expert", "60"),
        ("drawn_home", "half_good", "60"),
        ("drawn_home", "random", "60"),
        ("drawn_home", "expert", "30"),
    ]
    expert, half_good, random, short = (
        {name: float(row[name]) for name in COLUMNS[4:11]} for row in rows.values()
    )
    assert expert["mean_return"] > half_good["mean_return"] > random["mean_return"]
    assert expert["mean_return"] > short["mean_return"]
    for row in (expert, half_good, random, short):
        assert row["return_low"] <= row["mean_return"] <= row["return_high"]
        assert row["success_low"] <= row["success"] <= row["success_high"]
    assert (short["success"], short["success_low"], short["success_high"]) == (1.0, 1.0, 1.0)
    printed = capsys.readouterr().out
    assert f"| `drawn_home` | {expert['mean_return']:.1f} ({expert['return_low']:.1f} … " in printed


def test_it_goes_on_where_it_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, played = tmp_path / "returns.csv", []
    measured = task_returns.measured

    def interrupted_at_the_third(*arguments: object) -> object:
        played.append(arguments[1:3])
        if len(played) == 3:
            raise KeyboardInterrupt
        return measured(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(task_returns, "measured", interrupted_at_the_third)
    words = ["--tasks", "drawn_home", "--episodes", "1", "--out", str(out)]
    assert main(words) == 130
    assert len(read(out)) == 2
    assert "the same command goes on" in capsys.readouterr().err
    main(words)
    assert played[2:] == [("random", 60), ("random", 60), ("expert", 30)]
    main(words)
    assert len(played) == 5
    main([*words[:3], "2", *words[4:]])
    assert len(played) == 9, "another number of episodes is measured again"
    assert {row["episodes"] for row in read(out).values()} == {"2"}


def test_a_task_without_an_expert_has_a_sentence_until_there_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "returns.csv"
    words = ["--tasks", "drawn_home", "--episodes", "1", "--out", str(out)]
    with_expert = TASKS["drawn_home"]
    monkeypatch.setitem(TASKS, "drawn_home", replace(with_expert, has_expert=False))
    main(words)
    rows = read(out)
    assert not rows["drawn_home", "expert", "60"]["mean_return"]
    assert rows["drawn_home", "random", "60"]["mean_return"]
    assert "`drawn_home`: no expert is bundled yet: train one with" in capsys.readouterr().out
    monkeypatch.setitem(TASKS, "drawn_home", with_expert)
    main(words)
    assert all(row["mean_return"] and not row["note"] for row in read(out).values())


def test_meta_world_is_also_measured_within_its_own_limit() -> None:
    task = TASKS["button_press"]
    assert ("expert", 250) in measurements(task)
    assert ("random", 250) in measurements(task)
    row = dict.fromkeys(COLUMNS, "") | {"task": task.name, "who": "random", "episode_steps": "250"}
    row |= {"mean_return": "169.25", "return_low": "150", "return_high": "180"}
    printed = report([task], [row])
    assert "| `button_press` | – | – | – | 556.06 ± 6.46 | 153.29 ± 51.68 |" in printed
    assert "| `button_press` | – | 169.2 (150.0 … 180.0) |" in printed


def test_bad_words_give_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "returns.csv"
    assert main(["--episodes", "0", "--out", str(out)]) == 2
    assert "error: --episodes must be at least 1" in capsys.readouterr().err
    out.write_text("a,b\n")
    assert main(["--tasks", "drawn_home", "--out", str(out)]) == 2
    assert "is another table" in capsys.readouterr().err
