from pathlib import Path

import pytest
from benchmarks.figure_experts import draw, main

from bootifol.experts import BUNDLED


def test_every_bundled_expert_has_a_panel_with_its_curve(tmp_path: Path) -> None:
    task = "hopper_stand"
    other = tmp_path / f"{task}_without_shaping.csv"
    other.write_text("agent_steps,seconds,mean_return,lowest_return\n10,1,5.0,0\n20,2,7.5,0\n")
    panels = {axes.get_title(): axes for axes in draw(BUNDLED, tmp_path).axes}
    assert panels.keys() == {"finger_turn_easy", "hopper_stand", "walker_run"}
    lines = {str(line.get_label()): line for line in panels[task].get_lines()}
    assert list(lines["without shaping"].get_ydata()) == [5.0, 7.5]  # type: ignore[arg-type]
    assert lines["the paper's expert"].get_ydata()[0] == 880.93  # type: ignore[index]
    assert main(["--out", str(tmp_path / "experts.png")]) == 0
    assert (tmp_path / "experts.png").stat().st_size > 10_000


def test_without_experts_there_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--out", str(tmp_path / "experts.png"), "--bundled", str(tmp_path)]) == 2
    assert "no expert lies in" in capsys.readouterr().err
