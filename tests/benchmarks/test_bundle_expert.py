from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.bundle_expert import main
from benchmarks.rows import write_rows

from bootifol.experts.policy import StatePolicy
from bootifol.experts.states import StateEnvironment
from bootifol.experts.train import COLUMNS
from bootifol.files import read_json, write_json
from bootifol.tasks import TASKS

CURVE = {10: 3.0, 20: 90.0, 30: 50.0, 40: 80.0, 50: 5.0}
TRUE_RETURNS = {10: 2.0, 20: 60.0, 30: 44.0, 40: 82.0, 50: 7.0}


@pytest.fixture
def trained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A training whose curve praises one policy too much; a policy's only bias is its agent steps."""
    directory = tmp_path / "trained"
    (directory / "policies").mkdir(parents=True)
    rows = []
    for steps, mean_return in CURVE.items():
        StatePolicy([(np.zeros((2, 6)), np.full(2, float(steps)))]).save(
            directory / "policies" / f"{steps}.safetensors"
        )
        rows.append(
            {
                "agent_steps": str(steps),
                "seconds": "1",
                "mean_return": str(mean_return),
                "lowest_return": "0",
            }
        )
    write_rows(directory / "curve.csv", COLUMNS, rows)
    write_json(directory / "training.json", {"config": {"task": "reacher_hard", "seed": 1}, "versions": {}})
    monkeypatch.setitem(TASKS, "reacher_hard", replace(TASKS["reacher_hard"], evaluation_steps=2))
    return directory


def judged(policy: StatePolicy, environment: StateEnvironment, episodes: int, first_seed: int) -> list[float]:
    assert first_seed > 10**6 and isinstance(environment, StateEnvironment)
    return [TRUE_RETURNS[int(policy.layers[0][1][0])]] * episodes


def test_the_policies_that_more_starts_prefer_are_bundled(
    trained: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("benchmarks.bundle_expert.evaluate_policy", judged)
    out = tmp_path / "bundled"
    assert main([str(trained), "--candidates", "2", "--out", str(out)]) == 0
    for name, steps in (("reacher_hard", 40), ("reacher_hard.half_trained", 30)):
        kept = (trained / "policies" / f"{steps}.safetensors").read_bytes()
        assert (out / f"{name}.safetensors").read_bytes() == kept
    assert (out / "reacher_hard.csv").read_bytes() == (trained / "curve.csv").read_bytes()
    described = read_json(out / "reacher_hard.json", "")
    assert described["expert"] == {"agent_steps": 40, "mean_return": 82.0}
    assert described["half_trained"] == {"agent_steps": 30, "mean_return": 44.0}
    assert described["config"] == {"task": "reacher_hard", "seed": 1}


def test_judging_plays_the_task(trained: Path, tmp_path: Path) -> None:
    assert main([str(trained), "--candidates", "1", "--episodes", "1", "--out", str(tmp_path)]) == 0
    assert read_json(tmp_path / "reacher_hard.json", "")["judged_episodes"] == 1


def test_a_directory_without_a_training_gets_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(tmp_path)]) == 2
    assert "training.json" in capsys.readouterr().err
    assert not (tmp_path / "bundled").exists()
