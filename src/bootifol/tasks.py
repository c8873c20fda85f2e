"""The catalogue: a task is an environment, its expert, and the lengths of its episodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from bootifol.envs.pictures import PictureConfig
from bootifol.envs.pixels import PixelEnvironment, Simulator
from bootifol.errors import BootifolError


@dataclass(frozen=True)
class Task:
    """One entry of the catalogue."""

    name: str
    suite: Literal["DeepMind Control", "drawn with numpy"]
    description: str
    make_simulator: Callable[[PictureConfig], Simulator]
    action_repeat: int
    """Simulator steps an agent step."""
    episode_steps: int
    """Agent steps of a training episode and of a demonstration."""
    evaluation_steps: int
    """Agent steps of an evaluation episode, on which returns are scaled."""
    expert_return: float
    """Measured mean over episodes of `evaluation_steps`: 1 on the scale of returns."""
    random_return: float
    """The same for uniformly random actions: 0 on the scale."""
    has_expert: bool = True
    """Whether a scripted expert is bundled."""


def _reacher_hard(pictures: PictureConfig) -> Simulator:
    from bootifol.envs.dm_control import DMControlSimulator

    return DMControlSimulator("reacher", "hard", pictures)


def _finger_turn_easy(pictures: PictureConfig) -> Simulator:
    from bootifol.envs.dm_control import DMControlSimulator

    return DMControlSimulator("finger", "turn_easy", pictures)


def _hopper_stand(pictures: PictureConfig) -> Simulator:
    from bootifol.envs.dm_control import DMControlSimulator

    return DMControlSimulator("hopper", "stand", pictures)


def _walker_run(pictures: PictureConfig) -> Simulator:
    from bootifol.envs.dm_control import DMControlSimulator

    return DMControlSimulator("walker", "run", pictures)


def _drawn_reach(pictures: PictureConfig) -> Simulator:
    from bootifol.envs.drawn import DrawnReach

    return DrawnReach(pictures)


def _drawn_home(pictures: PictureConfig) -> Simulator:
    from bootifol.envs.drawn import DrawnReach

    return DrawnReach(pictures, fixed_target=(0.45, -0.3))


# The returns were measured with `bootifol tasks --measure 50`.
TASKS = {
    task.name: task
    for task in (
        Task(
            name="reacher_hard",
            suite="DeepMind Control",
            description="bring a two-link arm's fingertip onto a small target and keep it there",
            make_simulator=_reacher_hard,
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=980.5,
            random_return=14.1,
        ),
        Task(
            name="finger_turn_easy",
            suite="DeepMind Control",
            description="turn a spinner with a finger until its tip lies on a large target",
            make_simulator=_finger_turn_easy,
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=1000.0,
            random_return=0.0,
            has_expert=False,
        ),
        Task(
            name="hopper_stand",
            suite="DeepMind Control",
            description="stand up on one leg and stay upright",
            make_simulator=_hopper_stand,
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=1000.0,
            random_return=0.0,
            has_expert=False,
        ),
        Task(
            name="walker_run",
            suite="DeepMind Control",
            description="run on two legs",
            make_simulator=_walker_run,
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=1000.0,
            random_return=0.0,
            has_expert=False,
        ),
        Task(
            name="drawn_reach",
            suite="drawn with numpy",
            description="move a dot onto a disc and keep it there; needs no simulator",
            make_simulator=_drawn_reach,
            action_repeat=1,
            episode_steps=30,
            evaluation_steps=60,
            expert_return=52.4,
            random_return=2.8,
        ),
        Task(
            name="drawn_home",
            suite="drawn with numpy",
            description="the same with the disc always in one place: learned in minutes",
            make_simulator=_drawn_home,
            action_repeat=1,
            episode_steps=30,
            evaluation_steps=60,
            expert_return=52.4,
            random_return=3.2,
        ),
    )
}


def task_named(name: str) -> Task:
    """Looks a task up.

    Raises:
        BootifolError: there is none of that name.
    """
    if name not in TASKS:
        raise BootifolError(
            f"there is no task '{name}'; the tasks are {', '.join(TASKS)} (see `bootifol tasks`)"
        )
    return TASKS[name]


def make_environment(task_name: str, pictures: PictureConfig, episode_steps: int) -> PixelEnvironment:
    """The environment of a task.

    Args:
        task_name: from the catalogue.
        pictures: how it is shown.
        episode_steps: agent steps after which an episode is cut.

    Raises:
        BootifolError: unknown task, or a machine that cannot render.
    """
    task = task_named(task_name)
    return PixelEnvironment(task.make_simulator(pictures), pictures, task.action_repeat, episode_steps)
