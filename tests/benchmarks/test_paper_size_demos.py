import sys
from pathlib import Path

import pytest
from benchmarks.paper_size_demos import SIZES, main

from bootifol.demos.demo_set import DemoSet


def test_the_sizes_are_the_papers() -> None:
    shapes = {name: (size.videos, size.agent_steps + 1, size.picture) for name, size in SIZES.items()}
    assert shapes == {"bootifol": (5000, 61, 64), "eff_bootifol": (1500, 51, 224)}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_it_records_reads_and_says_what_that_took(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--task", "drawn_home", "--videos", "3", "--workers", "1", "--out", str(tmp_path)]
    main([*words, "--batch", "2", "--gradient-steps", "0"])
    printed = capsys.readouterr().out
    assert len(DemoSet.open(tmp_path / "drawn_home-bootifol-3")) == 3
    assert "3 videos in" in printed
    assert "0.002 GB on disk" in printed
    assert "drew 4 videos" in printed
    assert main([*words, "--memory", "0"]) == 2
    assert "error: --memory must be at least 1" in capsys.readouterr().err
