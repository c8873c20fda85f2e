"""A run that Weights & Biases is told of, from its first step over a stop to its report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import wandb
from tiny_runs import ENDS_SOON

import bootifol
from bootifol.files import read_arrays


class StopsWhenItActs(bootifol.Callback):
    def on_log(self, phase: str, *_: object) -> None:
        if phase == "interactive":
            raise bootifol.StopTraining


def test_a_run_is_told_in_two_sessions_of_one_id_and_learns_what_it_learns_untold(
    tmp_path: Path, demos: Path, finished: Path, offline: None, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    short = replace(ENDS_SOON.evaluation, long_episodes=1, final_episodes=1, showcase_episodes=1)
    config = replace(ENDS_SOON, tracker="wandb", evaluation_steps=30, evaluation=short)
    bootifol.train("drawn_reach", demos, run, config=config, callbacks=[StopsWhenItActs()])
    assert bootifol.resume(run)
    assert capsys.readouterr().err.count("go to Weights & Biases, too, as the configuration says") == 2
    wandb.teardown()  # its own process has written everything when it has ended
    files = list(run.glob("wandb/offline-run-*/run-*.wandb"))
    identity = (run / "wandb" / "bootifol-id.txt").read_text().strip()
    assert {file.name for file in files} == {f"run-{identity}.wandb"}
    for told in (b"alignment/loss/total", b"interactive/episode/learned_reward", b"showcase/agent-0"):
        assert any(told in file.read_bytes() for file in files)
    (page,) = run.glob("wandb/offline-run-*/files/media/html/report*.html")
    assert page.read_text() == (run / "report.html").read_text()
    ours, theirs = (read_arrays(each / "policy.safetensors", "") for each in (run, finished))
    assert all((ours[name] == theirs[name]).all() for name in theirs)
