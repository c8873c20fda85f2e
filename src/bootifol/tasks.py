"""The catalogue: a task is an environment, its expert, and the lengths of its episodes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Literal

from bootifol.envs.pictures import PictureConfig
from bootifol.envs.pixels import PixelEnvironment, Simulator
from bootifol.errors import LONGEST_EPISODE, BootifolError, require_at_least, require_at_most
from bootifol.plugins import names_of_plugins, plugins

if TYPE_CHECKING:
    from bootifol.envs.any_gymnasium import GymnasiumSimulator


@dataclass(frozen=True)
class Task:
    """One entry of the catalogue."""

    name: str
    suite: Literal["DeepMind Control", "Meta-World", "Gymnasium", "drawn with numpy"]
    description: str
    make_simulator: Callable[[PictureConfig], Simulator]
    action_repeat: int
    """Simulator steps an agent step."""
    episode_steps: int
    """Agent steps of a training episode and of a demonstration."""
    evaluation_steps: int
    """Agent steps of an evaluation episode, on which returns are scaled."""
    expert_return: float | None
    """Measured mean over episodes of `evaluation_steps`: 1 on the scale of returns. None where nobody measured it:
    then there is no scale."""
    random_return: float | None
    """The same for uniformly random actions: 0 on the scale."""
    has_expert: bool = True
    """Whether an expert is bundled, scripted or trained."""


def _dm_control(domain: str, name: str) -> Callable[[PictureConfig], Simulator]:
    def make(pictures: PictureConfig) -> Simulator:
        from bootifol.envs.dm_control import DMControlSimulator

        return DMControlSimulator(domain, name, pictures)

    return make


def _meta_world(name: str) -> Callable[[PictureConfig], Simulator]:
    def make(pictures: PictureConfig) -> Simulator:
        from bootifol.envs.meta_world import MetaWorldSimulator

        return MetaWorldSimulator(name, pictures)

    return make


def _drawn_reach(pictures: PictureConfig) -> Simulator:
    from bootifol.envs.drawn import DrawnReach

    return DrawnReach(pictures)


def _drawn_home(pictures: PictureConfig) -> Simulator:
    from bootifol.envs.drawn import DrawnReach

    return DrawnReach(pictures, fixed_target=(0.45, -0.3))


# Returns over 50 episodes: those of the paper's tasks stand in results/tasks/returns.csv (`benchmarks.task_returns`),
# the drawn ones' are of `bootifol tasks --measure 50`.
TASKS = {
    task.name: task
    for task in (
        Task(
            name="reacher_hard",
            suite="DeepMind Control",
            description="bring a two-link arm's fingertip onto a small target and keep it there",
            make_simulator=_dm_control("reacher", "hard"),
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
            make_simulator=_dm_control("finger", "turn_easy"),
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=921.7,
            random_return=173.4,
        ),
        Task(
            name="hopper_stand",
            suite="DeepMind Control",
            description="stand up on one leg and stay upright",
            make_simulator=_dm_control("hopper", "stand"),
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=908.5,
            random_return=2.2,
        ),
        Task(
            name="walker_run",
            suite="DeepMind Control",
            description="run on two legs",
            make_simulator=_dm_control("walker", "run"),
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=718.7,
            random_return=24.8,
        ),
        Task(
            name="button_press",
            suite="Meta-World",
            description="press a button on the front of a box with a robot arm's gripper",
            make_simulator=_meta_world("button-press-v3"),
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=1153.3,
            random_return=345.4,
        ),
        Task(
            name="plate_slide",
            suite="Meta-World",
            description="slide a plate over the table into a goal with a robot arm's gripper",
            make_simulator=_meta_world("plate-slide-v3"),
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=9532.9,
            random_return=416.4,
        ),
        Task(
            name="drawer_close",
            suite="Meta-World",
            description="push an open drawer shut with a robot arm's gripper",
            make_simulator=_meta_world("drawer-close-v3"),
            action_repeat=2,
            episode_steps=60,
            evaluation_steps=500,
            expert_return=9243.9,
            random_return=2168.0,
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


UNLIMITED_STEPS = 200
"""Length of an episode, in simulator steps, of a Gymnasium environment that sets no time limit."""


def task_named(
    name: str,
    action_repeat: int | None = None,
    episode_steps: int | None = None,
    evaluation_steps: int | None = None,
) -> Task:
    """Looks a task up, or makes one of a Gymnasium environment.

    Args:
        name: from the catalogue, or `gymnasium:ID`, or `module:function`, or what an installed package brings.
        action_repeat: instead of the task's own; episodes then last as long in simulator steps as before.
        episode_steps: instead of the task's own, in agent steps.
        evaluation_steps: instead of the task's own, in agent steps.

    Raises:
        BootifolError: there is none of that name, its environment cannot be used, or a length is below 1.
    """
    if name in TASKS:
        task = TASKS[name]
    elif ":" in name or name in plugins("task"):
        task = _gymnasium_task(name)
    else:
        raise BootifolError(
            f"there is no task '{name}'; the tasks are {', '.join(TASKS)}{names_of_plugins('task')} (see `bootifol "
            "tasks`), and any Gymnasium environment as gymnasium:ID or MODULE:FUNCTION"
        )
    given = {
        "action_repeat": action_repeat,
        "episode_steps": episode_steps,
        "evaluation_steps": evaluation_steps,
    }
    changes = {field: value for field, value in given.items() if value is not None}
    if not changes:
        return task
    require_at_least(1, **changes)
    require_at_most(LONGEST_EPISODE, **changes)
    repeat = changes.get("action_repeat", task.action_repeat)
    changed = replace(
        task,
        action_repeat=repeat,
        episode_steps=changes.get(
            "episode_steps", math.ceil(task.episode_steps * task.action_repeat / repeat)
        ),
        evaluation_steps=changes.get(
            "evaluation_steps", math.ceil(task.evaluation_steps * task.action_repeat / repeat)
        ),
    )
    measured = (task.action_repeat, task.evaluation_steps)
    if (changed.action_repeat, changed.evaluation_steps) != measured:
        # The returns were measured on other episodes.
        changed = replace(changed, expert_return=None, random_return=None)
    return changed


def make_environment(
    task_name: str, pictures: PictureConfig, episode_steps: int, action_repeat: int | None = None
) -> PixelEnvironment:
    """The environment of a task.

    Args:
        task_name: as `task_named`.
        pictures: how it is shown.
        episode_steps: agent steps after which an episode is cut.
        action_repeat: simulator steps an agent step; None for the task's own.

    Raises:
        BootifolError: unknown task, or a machine that cannot render.
    """
    task = task_named(task_name, action_repeat)
    return PixelEnvironment(task.make_simulator(pictures), pictures, task.action_repeat, episode_steps)


def frames_per_second(task: Task) -> float | None:
    """Pictures a second of the task's episodes; None where its environment does not say how fast time passes.

    Raises:
        BootifolError: its environment cannot be made on this machine.
    """
    environment = make_environment(task.name, PictureConfig(), task.episode_steps, task.action_repeat)
    environment.close()
    return environment.metadata["render_fps"] if environment.knows_time else None


def short_name(task_name: str) -> str:
    """A task's name for files and titles: Pendulum-v1 of gymnasium:Pendulum-v1, my_robot.make of my_robot:make."""
    return task_name.removeprefix("gymnasium:").replace(":", ".")


@cache
def _gymnasium_task(name: str) -> Task:
    """The environment is made once to see whether it can be used, and how long its episodes are."""
    simulator = _gymnasium_simulator(name, PictureConfig())
    simulator.require_sights()
    steps = simulator.time_limit or UNLIMITED_STEPS
    simulator.close()
    return Task(
        name=name,
        suite="Gymnasium",
        description="an environment of yours; without an expert, so returns have no scale",
        make_simulator=partial(_gymnasium_simulator, name),
        action_repeat=1,
        episode_steps=steps,
        evaluation_steps=steps,
        expert_return=None,
        random_return=None,
        has_expert=False,
    )


def _gymnasium_simulator(name: str, pictures: PictureConfig) -> GymnasiumSimulator:
    from bootifol.envs.any_gymnasium import GymnasiumSimulator

    return GymnasiumSimulator(name, pictures)
