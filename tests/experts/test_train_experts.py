from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from bootifol.errors import BootifolError
from bootifol.experts.policy import StatePolicy
from bootifol.experts.states import StateEnvironment
from bootifol.experts.train import ExpertConfig, extract_policy, train_expert
from bootifol.files import read_arrays, read_json
from bootifol.tasks import TASKS

pytest.importorskip("sb3_contrib")

CONFIG = ExpertConfig(
    "reacher_hard", hidden_dims=(8, 8), agent_steps=60, evaluation_every=30, evaluation_episodes=1
)


@pytest.fixture
def short_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TASKS, "reacher_hard", replace(TASKS["reacher_hard"], evaluation_steps=20))


@pytest.mark.parametrize("algorithm", ["SAC", "CrossQ"])
def test_the_bundled_network_acts_like_the_trained_one(algorithm: str) -> None:
    import sb3_contrib
    import stable_baselines3

    environment = StateEnvironment("reacher_hard", 20)
    package: Any = stable_baselines3 if algorithm == "SAC" else sb3_contrib
    model = getattr(package, algorithm)(
        "MlpPolicy", environment, policy_kwargs={"net_arch": [16, 16]}, learning_starts=10, seed=0
    )
    model.learn(60)
    policy = extract_policy(model.actor)
    state, _ = environment.reset(seed=3)
    for _ in range(5):
        expected, _ = model.predict(state, deterministic=True)
        np.testing.assert_allclose(policy(state), expected, atol=1e-5)
        state, *_ = environment.step(expected)


def test_a_policy_survives_its_file_exactly(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    layers = [
        (rng.normal(size=shape).astype(np.float32), rng.normal(size=shape[0]).astype(np.float32))
        for shape in ((5, 3), (2, 5))
    ]
    policy = StatePolicy(layers)
    policy.save(tmp_path / "expert.safetensors")
    state = rng.normal(size=3)
    np.testing.assert_array_equal(StatePolicy.load(tmp_path / "expert.safetensors")(state), policy(state))
    hidden = np.maximum(layers[0][0].astype(float) @ state + layers[0][1], 0)
    expected = np.tanh(layers[1][0].astype(float) @ hidden + layers[1][1])
    np.testing.assert_allclose(policy(state), expected, rtol=1e-6)


@pytest.mark.usefixtures("short_episodes")
@pytest.mark.parametrize("n_step", [1, 3])
def test_training_goes_on_where_it_stopped(tmp_path: Path, n_step: int) -> None:
    torch.manual_seed(0)
    train_expert(replace(CONFIG, agent_steps=30, n_step=n_step), tmp_path / "run")
    train_expert(replace(CONFIG, n_step=n_step), tmp_path / "run")
    with (tmp_path / "run" / "curve.csv").open(newline="") as file:
        assert [row["agent_steps"] for row in csv.DictReader(file)] == ["30", "60"]
    assert (tmp_path / "run" / "expert.safetensors").exists()
    with pytest.raises(BootifolError, match="holds 60 agent steps, more than the 30"):
        train_expert(replace(CONFIG, agent_steps=30, n_step=n_step), tmp_path / "run")
    with pytest.raises(BootifolError, match=r"another expert \(different: seed\)"):
        train_expert(replace(CONFIG, seed=2, n_step=n_step), tmp_path / "run")


@pytest.mark.usefixtures("short_episodes")
def test_a_training_starts_from_another_with_other_settings(tmp_path: Path) -> None:
    first = replace(CONFIG, agent_steps=30)
    train_expert(first, tmp_path / "first")
    kept = {path: path.read_bytes() for path in (tmp_path / "first").rglob("*") if path.is_file()}
    second = replace(CONFIG, agent_steps=90, n_step=3, target_entropy=-4.0)
    for _ in range(2):  # the second call finds nothing left to do
        train_expert(second, tmp_path / "second", start_from=tmp_path / "first")
    assert {path: path.read_bytes() for path in kept} == kept, "the first training is as it was"
    with (tmp_path / "second" / "curve.csv").open(newline="") as file:
        assert [row["agent_steps"] for row in csv.DictReader(file)] == ["30", "60", "90"]
    description = read_json(tmp_path / "second" / "training.json", "the training")
    assert description["config"]["target_entropy"] == -4.0
    assert description["before"]["config"]["target_entropy"] is None
    assert description["before"]["agent_steps"] == 30


@pytest.mark.usefixtures("short_episodes")
def test_what_cannot_be_started_from_gets_a_sentence(tmp_path: Path) -> None:
    train_expert(replace(CONFIG, agent_steps=30), tmp_path / "first")
    with pytest.raises(BootifolError, match="its algorithm, hidden_dims are different"):
        other = replace(CONFIG, algorithm="CrossQ", hidden_dims=(4, 4))
        train_expert(other, tmp_path / "other", start_from=tmp_path / "first")
    with pytest.raises(BootifolError, match="training to start from"):
        train_expert(CONFIG, tmp_path / "other", start_from=tmp_path / "none")
    assert not (tmp_path / "other").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep me")
    with pytest.raises(BootifolError, match="choose another directory"):
        train_expert(CONFIG, tmp_path / "mine", start_from=tmp_path / "first")
    assert (tmp_path / "mine" / "notes.txt").read_text() == "keep me"


@pytest.mark.usefixtures("short_episodes")
def test_the_half_trained_policy_returned_about_half_of_the_best(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    returns = iter([10.0, 52.0, 100.0])
    monkeypatch.setattr("bootifol.experts.train.evaluate_policy", lambda *_: [next(returns)])
    train_expert(replace(CONFIG, agent_steps=90), tmp_path)
    for name, steps in (("half_trained", 60), ("expert", 90)):
        kept = (tmp_path / f"{name}.safetensors").read_bytes()
        assert kept == (tmp_path / "policies" / f"{steps}.safetensors").read_bytes()


def test_states_and_pictures_start_alike() -> None:
    states = StateEnvironment("reacher_hard", 20)
    first, _ = states.reset(seed=7)
    again, _ = states.reset(seed=7)
    other, _ = states.reset(seed=8)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_task_without_states_gets_a_sentence() -> None:
    with pytest.raises(BootifolError, match="has no states"):
        StateEnvironment("drawn_home", 20)


@pytest.mark.usefixtures("short_episodes")
def test_training_episodes_may_be_shorter_than_those_that_are_evaluated(tmp_path: Path) -> None:
    train_expert(replace(CONFIG, agent_steps=30, episode_steps=7), tmp_path)
    stored = read_arrays(tmp_path / "checkpoint" / "arrays.safetensors", "the checkpoint")
    assert np.flatnonzero(stored["replay/timeouts"]).tolist() == [6, 13, 20, 27]
    with pytest.raises(BootifolError, match="episode_steps must be at least 1, not 0"):
        replace(CONFIG, episode_steps=0)


def test_shaping_adds_nothing_but_the_difference_of_potentials() -> None:
    plain = StateEnvironment("hopper_stand", 30)
    shaped = StateEnvironment("hopper_stand", 30, shaping=3.0, discount=0.5)
    rng = np.random.default_rng(0)
    for environment in (plain, shaped):
        environment.reset(seed=1)
    for _ in range(30):
        before = plain._simulator.physics.height()
        action = rng.uniform(-1, 1, 4).astype(np.float32)
        (state, reward, *_), (same, more, *_) = plain.step(action), shaped.step(action)
        np.testing.assert_array_equal(state, same)
        after = plain._simulator.physics.height()
        assert more == pytest.approx(reward + 3.0 * (0.5 * after - before))
    with pytest.raises(BootifolError, match=r"reacher_hard has no potential .* hopper_stand has"):
        StateEnvironment("reacher_hard", 30, shaping=1.0)
