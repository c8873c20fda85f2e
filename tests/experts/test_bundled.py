"""The experts that were trained from states: what lies in the package plays as its description says."""

import sys

import numpy as np
import pytest

from bootifol.envs.pictures import PictureConfig
from bootifol.experts import BUNDLED, make_expert
from bootifol.experts.policy import StatePolicy
from bootifol.experts.states import StateEnvironment
from bootifol.experts.train import evaluate_policy
from bootifol.files import read_json
from bootifol.tasks import TASKS, make_environment

pytestmark = pytest.mark.usefixtures("requires_rendering")

TRAINED = sorted(path.stem for path in BUNDLED.glob("*.json"))


@pytest.mark.parametrize("task", TRAINED)
def test_a_bundled_expert_does_its_task_and_the_half_trained_one_does_it_half(task: str) -> None:
    described = read_json(BUNDLED / f"{task}.json", "the bundled expert")
    assert described["config"]["task"] == task and TASKS[task].has_expert
    expert, half_trained = described["expert"]["mean_return"], described["half_trained"]["mean_return"]
    assert 0.35 * expert < half_trained < 0.65 * expert
    environment = StateEnvironment(task, TASKS[task].evaluation_steps)
    played = np.mean(evaluate_policy(StatePolicy.load(BUNDLED / f"{task}.safetensors"), environment, 4, 0))
    environment.close()
    assert played == pytest.approx(expert, rel=0.3)


@pytest.mark.parametrize("task", TRAINED)
def test_nobody_needs_the_library_that_trained_it(task: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("stable_baselines3", "sb3_contrib"):
        monkeypatch.setitem(sys.modules, package, None)
    environment = make_environment(task, PictureConfig(8, 8, stack=1), 3)
    observation, _ = environment.reset(seed=0)
    actions = [make_expert(task, environment)(observation) for _ in range(2)]
    environment.close()
    np.testing.assert_array_equal(*actions)
    assert np.abs(actions).max() <= 1.0


def test_every_expert_comes_with_its_curve_and_little_weight() -> None:
    files = {path.name for path in BUNDLED.iterdir()}
    endings = ("safetensors", "half_trained.safetensors", "csv", "json")
    assert files == {f"{task}.{ending}" for task in TRAINED for ending in endings}
    assert sum((BUNDLED / name).stat().st_size for name in files) < 3e6
