import numpy as np
import pytest

from bootifol.envs.rollout import PlayedEpisode
from bootifol.errors import BootifolError
from bootifol.evaluation import returns
from bootifol.evaluation.returns import (
    EpisodeResult,
    behavior_results,
    evaluate,
    evaluation_rows,
    scaled_return,
    unseen_environment,
)
from bootifol.tasks import TASKS
from bootifol.types import Episode, Video


def played(seed: int, name: str) -> PlayedEpisode:
    frames = np.zeros((3, 4, 4, 3), np.uint8)
    episode = Episode(frames, np.zeros((2, 1), np.float32), Video(name, frames), terminated=False)
    return PlayedEpisode(episode=episode, environment_return=float(seed * 10), success=seed > 1, seed=seed)


def test_each_seed_gives_one_result_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    names: list[str] = []

    def fake_play(environment: object, act: object, seed: int, name: str) -> PlayedEpisode:
        names.append(name)
        return played(seed, name)

    monkeypatch.setattr(returns, "play_episode", fake_play)
    results = evaluate(None, None, [3, 1])  # type: ignore[arg-type]
    assert results == [EpisodeResult(3, 30.0, True), EpisodeResult(1, 10.0, False)]
    assert len(set(names)) == 2


def test_a_behavior_plays_its_own_seeds_without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    task = TASKS["drawn_reach"]
    environment = unseen_environment(task, 40)
    monkeypatch.setattr(environment.simulator, "render", lambda: pytest.fail("nobody looks at the pictures"))
    results = list(behavior_results("random", task, environment, [5, 6]))
    assert [result.seed for result in results] == [5, 6]
    assert results[1:] == list(behavior_results("random", task, environment, [6])), (
        "episodes do not depend on others"
    )
    [expert] = behavior_results("expert", task, environment, [5])
    assert expert.environment_return > results[0].environment_return
    assert expert.success


def test_without_measured_returns_there_is_no_scale() -> None:
    assert scaled_return(1.0, expert_return=None, random_return=0.0) is None
    assert scaled_return(1.0, expert_return=1.0, random_return=None) is None


def test_scaled_return_is_not_clipped() -> None:
    assert scaled_return(50.0, expert_return=100.0, random_return=0.0) == 0.5
    assert scaled_return(110.0, expert_return=100.0, random_return=10.0) == pytest.approx(100 / 90)
    assert scaled_return(0.0, expert_return=100.0, random_return=10.0) < 0
    with pytest.raises(BootifolError, match="not above the random"):
        scaled_return(1.0, expert_return=5.0, random_return=5.0)


def test_rows_hold_scale_and_order() -> None:
    rows = evaluation_rows(
        [EpisodeResult(11, 20.0, None), EpisodeResult(12, 60.0, True)],
        agent_steps=500,
        seconds=1.23456,
        episode_steps=60,
        expert_return=60.0,
        random_return=10.0,
    )
    assert [row.scaled_return for row in rows] == [0.2, 1.0]
    assert [(row.episode, row.seed, row.success) for row in rows] == [(0, 11, None), (1, 12, True)]
    unscaled = evaluation_rows(
        [EpisodeResult(1, 2.0, None)],
        agent_steps=0,
        seconds=0.0,
        episode_steps=60,
        expert_return=None,
        random_return=None,
    )
    assert unscaled[0].scaled_return is None
