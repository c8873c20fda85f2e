import csv
from pathlib import Path

import numpy as np
import pytest

from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.tasks import TASKS, make_environment, short_name, task_named

PAPERS_TASKS = [name for name in TASKS if not name.startswith("drawn")]


@pytest.mark.parametrize("task", TASKS.values(), ids=list(TASKS))
def test_the_catalogue_is_consistent(task: object) -> None:
    assert task is task_named(task.name)  # type: ignore[attr-defined]
    meta_world = task.suite == "Meta-World"  # type: ignore[attr-defined]
    # Meta-World rewards up to 10 a simulator step, and a little for being near.
    # Random actions hit the spinner now and then, and the drawer closes at the lightest push.
    fraction, most_a_step = (0.3, 10.0 if meta_world else 1.0)
    steps = task.evaluation_steps * task.action_repeat  # type: ignore[attr-defined]
    assert task.random_return > 0  # type: ignore[attr-defined]
    assert task.has_expert == (task.expert_return is not None)  # type: ignore[attr-defined]
    if task.has_expert:  # type: ignore[attr-defined]
        assert task.random_return < fraction * task.expert_return  # type: ignore[attr-defined]
        assert task.expert_return <= most_a_step * steps  # type: ignore[attr-defined]
    assert 0 < task.episode_steps <= task.evaluation_steps  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", PAPERS_TASKS)
def test_the_scale_of_returns_is_the_measured_one(name: str) -> None:
    with (Path(__file__).parents[1] / "results/tasks/returns.csv").open(newline="") as file:
        measured = {
            row["who"]: float(row["mean_return"])
            for row in csv.DictReader(file)
            if (row["task"], row["episode_steps"]) == (name, "500") and row["mean_return"]
        }
    task = task_named(name)
    assert task.random_return == pytest.approx(measured["random"], abs=0.06)
    assert task.has_expert == ("expert" in measured)
    if task.expert_return is not None:
        assert task.expert_return == pytest.approx(measured["expert"], abs=0.06)


@pytest.mark.parametrize("name", PAPERS_TASKS)
def test_the_papers_tasks_have_its_lengths(name: str) -> None:
    task = task_named(name)
    assert (task.action_repeat, task.episode_steps, task.evaluation_steps) == (2, 60, 500)


def test_an_unknown_task_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(BootifolError, match=r"no task 'reacher'; the tasks are .*reacher_hard"):
        task_named("reacher")
    with pytest.raises(BootifolError, match="bootifol tasks"):
        make_environment("", PictureConfig(), 1)


def test_lengths_can_be_changed_and_returns_of_other_episodes_are_no_scale() -> None:
    shorter = task_named("reacher_hard", episode_steps=30)
    assert (shorter.episode_steps, shorter.evaluation_steps, shorter.expert_return) == (30, 500, 980.5)
    coarser = task_named("reacher_hard", action_repeat=8)
    assert (coarser.action_repeat, coarser.episode_steps, coarser.evaluation_steps) == (8, 15, 125)
    assert coarser.expert_return is None and coarser.random_return is None
    assert task_named("reacher_hard", evaluation_steps=100).expert_return is None
    with pytest.raises(BootifolError, match="episode_steps must be at least 1, not 0"):
        task_named("reacher_hard", episode_steps=0)


def test_an_environment_has_the_length_and_pictures_asked_for() -> None:
    environment = make_environment("drawn_reach", PictureConfig(agent_size=20, video_size=12, stack=2), 7)
    observation, info = environment.reset(seed=0)
    assert observation.shape == (20, 20, 6)
    assert info["video_frame"].shape == (12, 12, 3)
    ends = [environment.step(np.zeros(2, np.float32))[3] for _ in range(7)]
    assert ends == [False] * 6 + [True]


def test_names_for_files_have_no_colons() -> None:
    names = ("reacher_hard", "gymnasium:Pendulum-v1", "gymnasium:robot:Reach-v0", "my.robot:make")
    assert [*map(short_name, names)] == ["reacher_hard", "Pendulum-v1", "robot.Reach-v0", "my.robot.make"]
