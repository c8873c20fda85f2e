"""What is collected of runs, by the command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from benchmarks.collect import main

from bootifol.reports.collection import read_runs


def write_run(run: Path, seed: int) -> Path:
    """The configuration and the only evaluation of a run."""
    run.mkdir(parents=True)
    (run / "config.json").write_text(json.dumps({"task": "drawn_home", "method": "virl", "seed": seed}))
    (run / "metrics.jsonl").write_text('{"phase": "interactive", "agent_steps": 240, "agent/q": 0.5}\n')
    columns = "agent_steps,seconds,episode_steps,episode,seed,environment_return,scaled_return,success"
    (run / "evaluations.csv").write_text(f"{columns}\n240,9.0,60,0,7,50.0,1.0,True\n")
    (run / "ranking.csv").write_text("agent_steps,kind,video,reward\n0,expert,expert-1,2.5\n")
    return run


def test_runs_are_named_by_their_place_or_as_their_own_directory(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for seed in (1, 2):
        write_run(tmp_path / "runs" / "virl" / f"seed{seed}", seed)
    alone, out = write_run(tmp_path / "alone", 3), tmp_path / "results" / "drawn_home"
    assert main([str(tmp_path / "runs"), str(alone), "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}: 3 runs added\n"
    found = {run.path.relative_to(out).as_posix(): run.seed for run in read_runs([out])}
    assert found == {"alone": 3, "virl/seed1": 1, "virl/seed2": 2}
    assert sorted(path.name for path in out.iterdir()) == ["evaluations.csv", "runs.json"]


def test_rankings_and_metrics_are_kept_on_request(tmp_path: Path) -> None:
    run, out = write_run(tmp_path / "run", 1), tmp_path / "kept"
    assert main([str(run), "--out", str(out), "--metrics", "agent/q", "--ranking"]) == 0
    assert (out / "metrics.csv").read_text() == "run,phase,step,name,value\nrun,interactive,240,agent/q,0.5\n"
    assert (out / "ranking.csv").read_text() == (
        "run,agent_steps,kind,video,reward\nrun,0,expert,expert-1,2.5\n"
    )
    assert main([str(run), "--out", str(out)]) == 0
    assert not (out / "metrics.csv").exists()


def test_bad_input_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, other = write_run(tmp_path / "a" / "seed1", 1), write_run(tmp_path / "b" / "seed1", 1)
    assert main([str(one), str(other), "--out", str(tmp_path / "kept")]) == 2
    assert "would both be seed1" in capsys.readouterr().err
    assert main([str(tmp_path / "c"), "--out", str(tmp_path / "kept")]) == 2
    assert "there is no directory" in capsys.readouterr().err
    assert not (tmp_path / "kept").exists()
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "runs.json").write_text("{")
    assert main([str(one), "--out", str(tmp_path / "kept")]) == 2
    assert "the list of the runs of the collection" in capsys.readouterr().err
