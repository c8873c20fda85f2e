"""The environment's own reward reaches evaluation only."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from tiny_runs import IMITATING_RUNS, WITH_DEMONSTRATIONS, new_run

from bootifol.envs.rollout import play_episode
from bootifol.errors import BootifolError
from bootifol.training import build
from bootifol.training.config import TrainingConfig


class NaNReward(gymnasium.Wrapper[Any, Any, Any, Any]):
    """The same environment with rewards that poison whatever touches them."""

    def step(self, action: Any) -> Any:
        observation, _, terminated, truncated, info = self.env.step(action)
        return observation, float("nan"), terminated, truncated, info


@pytest.fixture
def nan_rewards(monkeypatch: pytest.MonkeyPatch) -> None:
    make = build.make_environment
    monkeypatch.setattr(build, "make_environment", lambda *arguments: NaNReward(make(*arguments)))


@pytest.mark.parametrize(("method", "config"), IMITATING_RUNS)
def test_nan_rewards_give_the_same_policy_bit_for_bit(
    tmp_path: Path, demos: Path, request: pytest.FixtureRequest, method: str, config: TrainingConfig
) -> None:
    usual = new_run(tmp_path / "usual", demos, method, config)
    assert usual.learn()
    request.getfixturevalue("nan_rewards")
    poisoned = new_run(tmp_path / "poisoned", demos, method, config)
    assert np.isnan(
        play_episode(poisoned.parts.environment, poisoned.interactive._act, 1, "x").environment_return
    )
    poisoned = new_run(tmp_path / "again", demos, method, config)
    assert poisoned.learn()
    for name, component in usual.parts.stateful().items():
        theirs = poisoned.parts.stateful()[name].state()
        for key, array in component.state().items():
            np.testing.assert_array_equal(array, theirs[key], err_msg=f"{name}: {key}")


def test_the_upper_bound_does_read_it(tmp_path: Path, demos: Path, nan_rewards: None) -> None:
    """The counterpart: without it, the test above could pass because nothing learns."""
    with pytest.raises(BootifolError, match="finite"):
        new_run(tmp_path / "run", demos, method="environment").learn()


def test_the_upper_bound_has_no_demonstrations(tmp_path: Path, demos: Path) -> None:
    """They would need the rewards of an expert's videos, and no video tells them."""
    run = new_run(tmp_path / "run", demos, method="environment", config=WITH_DEMONSTRATIONS)
    assert run.parts.demonstrations is None
    assert run.learn()
