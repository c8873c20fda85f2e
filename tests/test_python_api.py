"""Every function of the library, from videos to a table."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bootifol
from bootifol.envs.pictures import PictureConfig
from bootifol.presets import SMOKE


def test_the_functions_run_one_after_another(tmp_path: Path) -> None:
    from dataclasses import replace

    pictures = PictureConfig(agent_size=32, video_size=32)
    config = replace(SMOKE, pictures=pictures, agent=replace(SMOKE.agent, encoder="strided"), threads=1)
    config = replace(
        config,
        alignment=replace(config.alignment, gradient_steps=3),
        interactive=replace(config.interactive, agent_steps=300),
        tracker="none",
    )
    demos, out = str(tmp_path / "demos"), str(tmp_path / "run")
    bootifol.record_demos("drawn_reach", demos, episodes=12, pictures=pictures)
    run = bootifol.train("drawn_reach", demos, out, preset="smoke", config=config)
    assert (run.directory, run.finished) == (tmp_path / "run", True)
    assert isinstance(bootifol.evaluate(run, episodes=1).scaled_return, float)
    policy = bootifol.load_policy(run)
    assert policy.act(np.zeros((40, 50, 3), np.uint8)).shape == (2,)
    rewards = bootifol.score(run, [f"{demos}/expert"])
    assert len(rewards) == 12
    assert bootifol.report([run], f"{out}/report.html").is_file()
    assert "Drawn Reach" in bootifol.table([run])
    assert bootifol.resume(out), "it has ended already"


def test_every_public_name_exists() -> None:
    for name in bootifol.__all__:
        assert getattr(bootifol, name)
    with pytest.raises(AttributeError, match="nothing_like_it"):
        _ = bootifol.nothing_like_it


def test_importing_the_package_does_not_import_pytorch() -> None:
    code = "import sys, bootifol; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
