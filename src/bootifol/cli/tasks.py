"""`bootifol tasks`: the catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import rich.box
import tyro
from rich.console import Console
from rich.table import Table
from rich.text import Text

from bootifol.errors import BootifolError
from bootifol.plugins import GROUPS, package_of, plugins
from bootifol.tasks import TASKS, Task, frames_per_second, short_name, task_named


def tasks(
    names: Annotated[
        tuple[str, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="[NAME ...]", help_behavior_hint="(default: all)"),
    ] = (),
    measure: int = 0,
) -> int:
    """List the tasks, the lengths of their episodes, and the returns of their expert and of random actions.

    Args:
        names: Tasks to list. gymnasium:ID, MODULE:FUNCTION and what installed packages bring are tasks, too.
        measure: Play this many evaluation episodes (seeds 0, 1, …) of each task's expert and of random actions, and
            print their mean return, standard deviation, 95% interval, and the fraction of episodes that succeeded at
            any step, where the environment says so.
    """
    if measure < 0:
        raise BootifolError(f"--measure is a number of episodes, not {measure}")
    catalogue = _table("task", "suite", "repeat", "steps", "evaluated", "expert", "random")
    listed = [task_named(name) for name in names] or list(TASKS.values())
    for task in listed:
        catalogue.add_row(
            Text(task.name),
            task.suite,
            str(task.action_repeat),
            str(task.episode_steps),
            str(task.evaluation_steps),
            "–" if task.expert_return is None else f"{task.expert_return:g}",
            "–" if task.random_return is None else f"{task.random_return:g}",
        )
    console = Console(emoji=False)
    console.print(catalogue)
    for task in listed:
        console.print(f"{task.name}: {task.description}", highlight=False, markup=False)
    console.print(
        "repeat: simulator steps an agent step; steps, evaluated: agent steps of a training and an evaluation episode; "
        "expert, random: mean returns of evaluation episodes",
        style="dim",
    )
    if not names:
        console.print(
            "any Gymnasium environment with continuous actions is a task, too: gymnasium:ID, or MODULE:FUNCTION",
            style="dim",
            highlight=False,
        )
        for kind in GROUPS:
            for name, entries in plugins(kind).items():
                brought = " and ".join(map(package_of, entries))
                console.print(
                    f"--{kind} {name}: brought by {brought}", highlight=False, markup=False, soft_wrap=True
                )
    if measure:
        console.print(_measured(listed, measure))
    for task in listed if names else []:
        console.print(_how_to_import(task), soft_wrap=True, highlight=False, markup=False)
    return 0


def _how_to_import(task: Task) -> str:
    """The command that brings one's own videos to the task's pace and length."""
    try:
        rate = frames_per_second(task)
    except BootifolError as error:  # the catalogue is for every machine, also for one that cannot render
        return f"pictures a second of {task.name} are not known here: {error}"
    fps = "" if rate is None else f"--fps {rate:g} "
    shape = f"{fps}--frames {task.episode_steps + 1}"
    return (
        f"import your videos with: bootifol demos import VIDEOS {shape} --out demos/{short_name(task.name)}"
    )


def _table(*headings: str) -> Table:
    """Narrow enough for a terminal of 80 columns; only names, which may be long, are broken."""
    table = Table(*headings, box=rich.box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.columns[0].overflow = "fold"
    for column in table.columns[1:]:
        column.no_wrap = True
    return table


def _measured(listed: Sequence[Task], episodes: int) -> Table:
    """Returns of each task's expert and of random actions, played now."""
    # Imported here: the simulators and scipy would slow down every other command's help.
    import numpy as np

    from bootifol.evaluation.returns import behavior_results, unseen_environment
    from bootifol.evaluation.summary import summarize
    from bootifol.experts import Behavior
    from bootifol.progress import progress

    behaviors: tuple[Behavior, ...] = ("expert", "random")
    table = _table("task", "who", "episodes", "mean return ± std", "95% interval", "success")
    for task in listed:
        environment = unseen_environment(task, task.evaluation_steps)
        for who in behaviors if task.has_expert else behaviors[1:]:
            returns: list[float] = []
            successes: list[bool] = []
            with progress(f"{task.name}, {who}", episodes) as advance:
                for episode in behavior_results(who, task, environment, range(episodes)):
                    returns.append(episode.environment_return)
                    if episode.success is not None:
                        successes.append(episode.success)
                    advance(1, mean=float(np.mean(returns)))
            interval = summarize(returns).interval
            table.add_row(
                Text(task.name),
                who,
                str(episodes),
                f"{np.mean(returns):.2f} ± {np.std(returns):.2f}",
                "–" if interval is None else f"{interval[0]:.2f} … {interval[1]:.2f}",
                f"{np.mean(successes):.2f}" if successes else "–",
            )
        environment.close()
    return table
