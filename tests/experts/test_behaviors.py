from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from bootifol import experts
from bootifol.envs.pictures import PictureConfig
from bootifol.envs.pixels import PixelEnvironment
from bootifol.envs.rollout import play_episode
from bootifol.errors import BootifolError
from bootifol.experts import Behavior, make_behavior, make_expert
from bootifol.experts.behaviors import HalfGood
from bootifol.experts.policy import StatePolicy
from bootifol.tasks import make_environment
from bootifol.types import Action

SMALL = PictureConfig(agent_size=8, video_size=8, stack=1)
EXPERT, WRONG = [0.0, 7.0], [0.0, -7.0]
STEPS = 60


def played(task: str, behavior: Behavior, environment: PixelEnvironment, seed: int) -> Any:
    return play_episode(environment, make_behavior(behavior, task, environment, seed), seed, behavior)


def mean_return(
    monkeypatch: pytest.MonkeyPatch, task: str, behavior: Behavior, steps: int, episodes: int
) -> float:
    environment = make_environment(task, SMALL, steps)
    black = np.zeros((8, 8, 3), np.uint8)
    # Nobody looks at the pictures.
    monkeypatch.setattr(environment.simulator, "render", lambda: black)
    returns = [played(task, behavior, environment, seed).environment_return for seed in range(episodes)]
    environment.close()
    return float(np.mean(returns))


def half_good_actions(seed: int) -> NDArray[np.float32]:
    """The actions of one episode, where the expert's are `EXPERT` and the way to the wrong place is `WRONG`."""

    def controller(goal: NDArray[np.float64] | None) -> Action:
        return np.array(EXPERT if goal is None else goal, np.float32)

    environment = make_environment("drawn_reach", SMALL, STEPS)
    act = HalfGood(controller, environment, seed, lambda rng: np.array(WRONG))
    observation, _ = environment.reset(seed=seed)
    return np.stack([act(observation) for _ in range(STEPS)])


def test_half_good_is_the_half_trained_policy_where_one_is_bundled(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(experts, "BUNDLED", tmp_path)
    environment = make_environment("drawn_reach", SMALL, STEPS)
    monkeypatch.setattr(environment.simulator, "state", lambda: np.array([0.5]), raising=False)
    StatePolicy([(np.array([[1.0], [-2.0]]), np.zeros(2))]).save(tmp_path / "drawn_reach.safetensors")
    StatePolicy([(np.array([[4.0], [0.0]]), np.zeros(2))]).save(
        tmp_path / "drawn_reach.half_trained.safetensors"
    )
    observation, _ = environment.reset(seed=0)
    actions = [
        make_behavior(behavior, "drawn_reach", environment, 0)(observation)
        for behavior in ("expert", "half_good")
    ]
    np.testing.assert_allclose(actions, np.tanh([[0.5, -1.0], [2.0, 0.0]]), rtol=1e-6)


def test_half_good_is_one_of_three_kinds() -> None:
    kinds = []
    for seed in range(40):
        actions = half_good_actions(seed)
        expert = (actions == EXPERT).all(axis=1)
        if expert[0] and expert[:20].all() and not expert[20:].any():
            kinds.append("expert, then random")
            assert np.abs(actions[20:]).max() <= 1.0
        elif expert.any():
            kinds.append("random, expert in between")
            assert 0.05 < expert.mean() < 0.5
            assert np.abs(actions[~expert]).max() <= 1.0
        else:
            kinds.append("wrong place")
            assert (actions == WRONG).all()
    assert {kind: kinds.count(kind) >= 5 for kind in set(kinds)} == {
        "expert, then random": True,
        "random, expert in between": True,
        "wrong place": True,
    }


@pytest.mark.parametrize("behavior", get_args(Behavior))
def test_a_seed_decides_everything_a_behavior_does(behavior: Behavior) -> None:
    environment = make_environment("drawn_reach", SMALL, STEPS)
    actions = [played("drawn_reach", behavior, environment, seed).episode.actions for seed in (1, 2, 1)]
    np.testing.assert_array_equal(actions[0], actions[2])
    if behavior == "still":
        assert not actions[0].any()
    else:
        assert not np.array_equal(actions[0], actions[1])
    assert np.abs(actions).max() <= 1.0


def test_random_actions_cover_the_range() -> None:
    environment = make_environment("drawn_reach", SMALL, 500)
    actions = played("drawn_reach", "random", environment, 0).episode.actions
    assert actions.min() < -0.98
    assert actions.max() > 0.98
    assert abs(actions.mean()) < 0.1


def test_drawn_reach_expert_beats_half_good_beats_random(monkeypatch: pytest.MonkeyPatch) -> None:
    expert, half_good, random = (
        mean_return(monkeypatch, "drawn_reach", behavior, STEPS, 20)
        for behavior in ("expert", "half_good", "random")
    )
    assert expert > 45
    assert 10 < half_good < 0.75 * expert
    assert random < 0.5 * half_good


@pytest.mark.usefixtures("requires_rendering")
def test_reacher_expert_beats_half_good_beats_random(monkeypatch: pytest.MonkeyPatch) -> None:
    expert, half_good, random = (
        mean_return(monkeypatch, "reacher_hard", behavior, 100, 2)
        for behavior in ("expert", "half_good", "random")
    )
    assert expert > 150, "of 200: on the target after a few dozen simulator steps, and it stays"
    assert random + 10 < half_good < 0.8 * expert


def test_an_unknown_behavior_and_a_task_without_expert_are_refused_with_a_sentence() -> None:
    environment = make_environment("drawn_reach", SMALL, 2)
    with pytest.raises(BootifolError, match="no behavior 'perfect'; choose among expert, half_good"):
        make_behavior("perfect", "drawn_reach", environment, 0)  # type: ignore[arg-type]
    with pytest.raises(BootifolError, match="no expert for the task juggling; import videos"):
        make_expert("juggling", environment)
