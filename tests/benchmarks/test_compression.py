from pathlib import Path

import numpy as np
import pytest
from benchmarks.compression import COLUMNS, main, summarized
from benchmarks.rows import read_rows


def test_every_video_is_rewarded_four_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "compression.csv"
    small = ["--preset", "drawn_pixels", "--videos", "16", "--held-out", "4", "--gradient-steps", "2"]
    words = ["--task", "drawn_home", *small, "--demos", str(tmp_path / "demos"), "--out", str(out)]
    assert main(words) == 0
    rows = read_rows(out, COLUMNS)
    kinds = {(row["augmentation"], row["kind"], row["pictures"]) for row in rows}
    assert len(kinds) == 2 * 3 * 2 and len(rows) == 4 * len(kinds)
    rewards = {row["reward"] for row in rows if row["augmentation"] == "never"}
    assert len(rewards) > 12, "files and recordings of the same video are two videos"
    printed = capsys.readouterr().out
    assert "| never |" in printed and "| always |" in printed
    assert main([*words, "--videos", "1"]) == 2


@pytest.mark.parametrize(("marks", "crossed", "shift"), [(0.0, 1.0, 0.0), (20.0, 0.0, 2.0)])
def test_a_reward_of_compression_is_told_from_one_of_the_task(
    marks: float, crossed: float, shift: float
) -> None:
    rewards = {
        ("never", kind, pictures): np.array([task, task + 1.0]) + (marks if pictures == "mp4" else 0.0)
        for kind, task in (("expert", 10.0), ("half_good", 5.0), ("random", 0.0))
        for pictures in ("recorded", "mp4")
    }
    assert summarized(rewards, "never") == (1.0, 1.0, crossed, shift)
