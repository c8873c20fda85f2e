"""`bootifol tasks`: the catalogue."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from bootifol.errors import BootifolError
from bootifol.tasks import TASKS, Task, task_named


def tasks(measure: int = 0, task: str | None = None) -> int:
    """List the tasks, the lengths of their episodes, and the returns of their expert and of random actions.

    Args:
        measure: Play this many evaluation episodes (seeds 0, 1, …) of each task's expert and of random actions, and
            print their mean return, standard deviation, 95% interval, and the share of episodes that succeeded at
            any step, where the environment says so.
        task: List and measure this task alone.
    """
    if measure < 0:
        raise BootifolError(f"--measure is a number of episodes, not {measure}")
    listed = list(TASKS.values()) if task is None else [task_named(task)]
    catalogue = Table(
        "task", "suite", "action repeat", "steps", "evaluation steps", "expert return", "random return"
    )
    for entry in listed:
        catalogue.add_row(
            entry.name,
            entry.suite,
            str(entry.action_repeat),
            str(entry.episode_steps),
            str(entry.evaluation_steps),
            f"{entry.expert_return:g}" if entry.has_expert else "–",
            f"{entry.random_return:g}",
        )
    for column in catalogue.columns[:2]:
        column.no_wrap = True
    console = Console()
    console.print(catalogue)
    for entry in listed:
        console.print(f"{entry.name}: {entry.description}", highlight=False)
    console.print(
        "steps: agent steps of a training episode; the returns are means over evaluation episodes",
        style="dim",
    )
    if measure:
        console.print(_measured(measure, listed))
    return 0


def _measured(episodes: int, listed: list[Task]) -> Table:
    """Returns of each task's expert and of random actions, played now."""
    # Imported here: the simulators and scipy would slow down every other command's help.
    import numpy as np

    from bootifol.envs.pictures import PictureConfig
    from bootifol.evaluation.returns import evaluate
    from bootifol.evaluation.summary import summarize
    from bootifol.experts import Behavior, make_behavior
    from bootifol.progress import progress
    from bootifol.tasks import make_environment

    behaviors: tuple[Behavior, ...] = ("expert", "random")
    pictures = PictureConfig(agent_size=8, video_size=8, stack=1)
    table = Table("task", "who", "episodes", "mean return ± std", "95% interval of the mean", "success")
    for task in listed:
        environment = make_environment(task.name, pictures, task.evaluation_steps)
        environment.rendered = False
        for who in behaviors if task.has_expert else behaviors[1:]:
            returns: list[float] = []
            successes: list[bool] = []
            with progress(f"{task.name}, {who}", episodes) as advance:
                for seed in range(episodes):
                    act = make_behavior(who, task.name, environment, seed)
                    [episode] = evaluate(environment, act, [seed])
                    returns.append(episode.environment_return)
                    if episode.success is not None:
                        successes.append(episode.success)
                    advance(1, mean=float(np.mean(returns)))
            interval = summarize(returns).interval
            table.add_row(
                task.name,
                who,
                str(episodes),
                f"{np.mean(returns):.2f} ± {np.std(returns):.2f}",
                "–" if interval is None else f"{interval[0]:.2f} … {interval[1]:.2f}",
                f"{np.mean(successes):.2f}" if successes else "–",
            )
        environment.close()
    return table
