from pathlib import Path

import numpy as np
import pytest
from benchmarks.figure import experts_figure, main
from matplotlib.colors import to_rgb
from PIL import Image

from bootifol.experts import BUNDLED


def test_every_bundled_expert_has_a_panel_with_its_curve(tmp_path: Path) -> None:
    task = "hopper_stand"
    other = tmp_path / f"{task}_without_shaping.csv"
    other.write_text("agent_steps,seconds,mean_return,lowest_return\n10,1,5.0,0\n20,2,7.5,0\n")
    panels = {axes.get_title(): axes for axes in experts_figure(BUNDLED, tmp_path).axes}
    assert panels.keys() == {"finger_turn_easy", "hopper_stand", "walker_run"}
    lines = {str(line.get_label()): line for line in panels[task].get_lines()}
    assert list(lines["without shaping"].get_ydata()) == [5.0, 7.5]  # type: ignore[arg-type]
    assert lines["the paper's expert"].get_ydata()[0] == 880.93  # type: ignore[index]


def test_a_dot_stands_where_the_expert_was_taken_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "hopper_stand.csv").write_text(
        "agent_steps,seconds,mean_return,lowest_return\n10,1,5.0,0\n20,2,9.0,0\n30,3,7.0,0\n"
    )
    (tmp_path / "hopper_stand.json").write_text('{"expert": {"agent_steps": 20}}')
    curve, dot, _ = experts_figure(tmp_path, tmp_path / "none").axes[0].get_lines()
    assert np.asarray(curve.get_xydata()).tolist() == [[10, 5], [20, 9], [30, 7]]
    assert np.asarray(dot.get_xydata()).tolist() == [[20, 9]]
    assert (dot.get_marker(), dot.get_color()) == ("o", curve.get_color())
    out = tmp_path / "experts.png"
    assert main(["experts", "--out", str(out), "--bundled", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"figure: {out}\n"
    with Image.open(out) as picture:
        # One panel of 3.6 inches, in which the curve's color is seen.
        assert (picture.format, picture.width) == ("PNG", 360)
        drawn = np.asarray(picture.convert("RGB")) / 255
    assert np.isclose(drawn, to_rgb(curve.get_color()), atol=0.01).all(axis=2).sum() > 50


def test_without_experts_there_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["experts", "--out", str(tmp_path / "experts.png"), "--bundled", str(tmp_path)]) == 2
    assert "no expert lies in" in capsys.readouterr().err
