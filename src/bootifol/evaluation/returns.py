"""How well an agent does: returns of episodes with fixed seeds, and their scale."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from bootifol.envs.pictures import PictureConfig
from bootifol.envs.pixels import PixelEnvironment
from bootifol.envs.rollout import Act, PlayedEpisode, play_episode
from bootifol.errors import BootifolError
from bootifol.evaluation.tables import EvaluationRow
from bootifol.experts import Behavior, make_behavior
from bootifol.tasks import Task, make_environment


@dataclass(frozen=True)
class EpisodeResult:
    """One evaluation episode."""

    seed: int
    """The seed its start was drawn with."""

    environment_return: float
    """Sum of the environment's own rewards, which reach evaluation only."""

    success: bool | None
    """Whether the task was solved, where the environment says so."""


def evaluation_seeds(run_seed: int, count: int, agent_steps: int = 0) -> list[int]:
    """Seeds of evaluation starts, which training never meets.

    Args:
        run_seed: of the run.
        count: of seeds.
        agent_steps: at which the policy is measured on the way, each time from other starts, so that what they have in
            common does not hide in the curve; 0 for the final evaluation's.
    """
    entropies = ([run_seed, 1, index, agent_steps] for index in range(count))
    return [int(np.random.SeedSequence(entropy).generate_state(1)[0]) for entropy in entropies]


def evaluate(
    environment: gymnasium.Env[Any, Any],
    act: Act,
    seeds: Sequence[int],
    name: str = "evaluation",
    watch: Callable[[int, PlayedEpisode], None] = lambda episode, played: None,
) -> list[EpisodeResult]:
    """Plays one episode a seed, without exploration noise if `act` adds none.

    Args:
        environment: from `make_environment`; its time limit is the length of the episodes.
        act: the policy.
        seeds: one per episode; the same seeds give the same starts in any process.
        name: prefix of the episodes' names.
        watch: called with each episode's number, from 0, and the episode.
    """
    results: list[EpisodeResult] = []
    for episode, seed in enumerate(seeds):
        played = play_episode(environment, act, seed, f"{name}-{seed}")
        watch(episode, played)
        results.append(EpisodeResult(seed, played.environment_return, played.success))
    return results


def unseen_environment(task: Task, episode_steps: int) -> PixelEnvironment:
    """The task's environment for performers who look at the simulator's state: its pictures are black and cost nothing.

    Args:
        task: from the catalogue.
        episode_steps: agent steps of an episode.
    """
    environment = make_environment(
        task.name, PictureConfig(agent_size=8, video_size=8, stack=1), episode_steps
    )
    environment.rendered = False
    return environment


def behavior_results(
    behavior: Behavior, task: Task, environment: PixelEnvironment, seeds: Iterable[int]
) -> Iterator[EpisodeResult]:
    """Plays one episode a seed with an expert, or whoever else records videos; the seed is the behavior's, too.

    Args:
        behavior: expert, half_good, random or still.
        task: from the catalogue.
        environment: the task's, from `unseen_environment` or `make_environment`.
        seeds: one per episode.

    Raises:
        BootifolError: the task has no expert and the behavior wants one.
    """
    for seed in seeds:
        yield from evaluate(environment, make_behavior(behavior, task.name, environment, seed), [seed])


def scaled_return(
    environment_return: float, *, expert_return: float | None, random_return: float | None
) -> float | None:
    """(R - R_random) / (R_expert - R_random): 0 for a random agent, 1 for the expert, not clipped.

    The three returns must come from episodes of one length. None where the expert's or the random agent's is not known.

    Raises:
        BootifolError: the expert is no better than random, so there is no scale.
    """
    if expert_return is None or random_return is None:
        return None
    if not expert_return > random_return:
        raise BootifolError(
            f"returns cannot be scaled: the expert's return {expert_return:g} is not above the random "
            f"agent's {random_return:g}; measure both again on the same task"
        )
    return (environment_return - random_return) / (expert_return - random_return)


def evaluation_rows(
    results: Sequence[EpisodeResult],
    *,
    agent_steps: int,
    seconds: float,
    episode_steps: int,
    expert_return: float | None,
    random_return: float | None,
) -> list[EvaluationRow]:
    """The rows of `evaluations.csv` for one evaluation.

    Args:
        results: from `evaluate`.
        agent_steps: training so far, in agent steps.
        seconds: training so far, in wall-clock seconds.
        episode_steps: length of the episodes in agent steps.
        expert_return: mean return of the expert over episodes of this length; None where not known.
        random_return: the same for uniformly random actions.
    """
    return [
        EvaluationRow(
            agent_steps=agent_steps,
            seconds=round(seconds, 3),
            episode_steps=episode_steps,
            episode=episode,
            seed=result.seed,
            environment_return=result.environment_return,
            scaled_return=scaled_return(
                result.environment_return, expert_return=expert_return, random_return=random_return
            ),
            success=result.success,
        )
        for episode, result in enumerate(results)
    ]
