"""What a run measures and never learns from: returns of its policy, the order of held-out videos, a showcase."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from bootifol.envs.rollout import Act
from bootifol.evaluation.ranking import (
    EXPERT_ABOVE_RANDOM,
    KINDS,
    expert_above_random,
    rank_videos,
    ranking_scores,
)
from bootifol.evaluation.returns import evaluate, evaluation_rows, evaluation_seeds
from bootifol.evaluation.sample_episodes import play_sample_episodes, write_sample_episodes
from bootifol.evaluation.sight import in_words, perform, sight
from bootifol.evaluation.summary import summarize
from bootifol.evaluation.tables import EvaluationRow, append_evaluations, append_ranking
from bootifol.experts import make_expert, make_random
from bootifol.progress import progress
from bootifol.rewards.references import draw_references, reference_rng
from bootifol.training.budget import Budget, Counters
from bootifol.training.build import Parts, build_environment
from bootifol.training.interruption import Interruption
from bootifol.training.run_config import RunConfig
from bootifol.types import Action, Metrics, Observation, Rewards, Video


class Evaluator:
    """Appends what it measures to the files of a run's directory.

    Args:
        run: what it is.
        directory: where it writes.
        parts: the policy and the reward that are measured; held-out videos, and the expert's, which rewards compare
            with; the environment is for the showcase, evaluations make their own.
        budget: where schedules stand.
        counters: how far the run is.
        console: where sentences go.
        log: takes agent steps and metrics.
        interruption: where the run is asked to stop, a measurement is left off; nothing of it is written.
    """

    def __init__(
        self,
        run: RunConfig,
        directory: Path,
        parts: Parts,
        budget: Budget,
        counters: Counters,
        console: Console,
        log: Callable[[int, Metrics], None],
        interruption: Interruption,
    ) -> None:
        self._run, self._directory = run, directory
        self._task, self._config = parts.task, run.training.evaluation
        self._environment, self._expert = parts.environment, parts.demos.expert
        self._held_out, self._agent_videos = parts.demos.held_out, parts.agent_videos
        self._agent, self._reward_model = parts.agent, parts.reward_model
        self._budget, self._counters = budget, counters
        self._console, self._log = console, log
        self._interruption = interruption
        self.newest: dict[str, float] = {}
        """Returns of the newest evaluation, by name."""

    def final_returns(self) -> Metrics:
        """Of the final evaluation, by name."""
        seeds = evaluation_seeds(self._run.seed, self._config.final_episodes)
        return self._keep(self._play(self._task.evaluation_steps, seeds, "final evaluation"))

    def returns_on_the_way(self) -> None:
        """Of a few episodes of the training and of the evaluation length, from starts that no other evaluation has.

        What is left off in the middle has left nothing, so that it can be done again.
        """
        episodes = {self._task.episode_steps: self._config.episodes}
        # Where both lengths are one, it is evaluated once.
        same = episodes.get(self._task.evaluation_steps, 0)
        episodes[self._task.evaluation_steps] = max(same, self._config.long_episodes)
        played = []
        for episode_steps, count in episodes.items():
            if count:
                seeds = evaluation_seeds(self._run.seed, count, self._counters.agent_steps)
                played.append(self._play(episode_steps, seeds))
        for rows in played:
            self._keep(rows)

    def _play(
        self, episode_steps: int, seeds: Sequence[int], description: str | None = None
    ) -> list[EvaluationRow]:
        """Plays episodes without noise."""
        agent, counters = self._agent, self._counters
        environment = build_environment(self._run, episode_steps)
        steps = self._budget.scheduled_steps(counters)

        act = self._until_stopped(lambda observation: agent.act(observation, steps, explore=False))
        try:
            if description is None:
                results = evaluate(environment, act, seeds)
            else:
                with progress(description, len(seeds)) as advance:
                    results = evaluate(environment, act, seeds, watch=lambda _, __: advance(1))
        finally:
            environment.close()
        at_evaluation_length = episode_steps == self._task.evaluation_steps
        return evaluation_rows(
            results,
            agent_steps=counters.agent_steps,
            seconds=counters.seconds,
            episode_steps=episode_steps,
            expert_return=self._task.expert_return if at_evaluation_length else None,
            random_return=self._task.random_return if at_evaluation_length else None,
        )

    def _keep(self, rows: list[EvaluationRow]) -> Metrics:
        """Appends episodes of one length to `evaluations.csv`, and logs their mean return."""
        append_evaluations(self._directory / "evaluations.csv", rows)
        returns = summarize([row.environment_return for row in rows])
        metrics = {f"evaluation/return_{rows[0].episode_steps}": returns.mean}
        if rows[0].episode_steps == self._task.evaluation_steps and rows[0].scaled_return is not None:
            metrics["evaluation/scaled_return"] = float(np.mean([row.scaled_return for row in rows]))
        self._log(self._counters.agent_steps, metrics)
        self.newest.update(metrics)
        return metrics

    def _until_stopped(self, act: Act) -> Act:
        def stoppable(observation: Observation) -> Action:
            self._interruption.stop_if_requested()
            return act(observation)

        return stoppable

    def _one_by_one(self, videos: Iterable[Video]) -> Iterator[Video]:
        for video in videos:
            self._interruption.stop_if_requested()
            yield video

    def rank(self) -> None:
        """Appends the rewards of held-out videos, and of the agent's newest ones, to `ranking.csv`."""
        if not self._held_out or self._reward_model.reads_environment_reward:
            return
        videos: dict[str, list[Video]] = dict(self._held_out)
        if len(self._agent_videos):
            # Sums are compared, so of as many frames as the held-out videos have, where the agent's have more.
            frames = len(self._held_out["expert"][0].frames) if "expert" in videos else None
            videos["agent"] = [
                _cut(video, frames) for video in self._agent_videos.newest(self._config.held_out_videos)
            ]
        sees = self._sight()
        figures = {f"sight/{name}": value for name, value in sees.items()}
        rows = rank_videos(
            self._reward_model,
            {kind: self._one_by_one(of_kind) for kind, of_kind in videos.items()},
            self._expert,
            reference_rng(self._run.seed, self._counters.agent_steps),
            self._counters.agent_steps,
        )
        append_ranking(self._directory / "ranking.csv", rows)
        if all(kind in videos for kind in KINDS):
            scores = ranking_scores(rows)
            self._log(self._counters.agent_steps, {**scores.metrics(), **figures})
            of_videos = (
                f"the learned reward on held-out videos: Kendall's tau {scores.kendall_tau:.2f} (a perfect order has "
                f"{scores.perfect_tau:.2f}), expert above half-good {scores.expert_above_half_good:.0%}, half-good "
                f"above random {scores.half_good_above_random:.0%}"
            )
            self._console.print(in_words(sees) if sees else of_videos)
        elif {"expert", "random"} <= videos.keys():
            above = expert_above_random(rows)
            self._log(self._counters.agent_steps, {EXPERT_ABOVE_RANDOM: above, **figures})
            of_videos = f"the learned reward on held-out videos: expert above random {above:.0%}"
            self._console.print(in_words(sees) if sees else of_videos)

    def _sight(self) -> Metrics:
        """Whether the learned reward sees the task; nothing where nobody can play for it: for tasks without an expert,
        or where no episodes are wanted."""
        episodes = self._config.sight_episodes
        if not (episodes and self._task.has_expert):
            return {}
        model, expert = self._reward_model, self._expert
        rng = reference_rng(self._run.seed, self._counters.agent_steps)

        def label(video: Video) -> Rewards:
            return model.label(video, draw_references(model, expert, rng))

        performances = []
        for performance in perform(self._run.task, self._environment, label, episodes):
            performances.append(performance)
            self._interruption.stop_if_requested()
        return sight(performances)

    def sample_episodes(self) -> None:
        """Expert, agent and random from the same starts, with the reward along them, for the report."""
        count = self._config.showcase_episodes
        if not count:
            return
        agent, steps = self._agent, self._budget.scheduled_steps(self._counters)
        acts: dict[str, Act] = {
            "agent": lambda observation: agent.act(observation, steps, explore=False),
            "random": make_random(self._environment, self._run.seed),
        }
        if self._task.has_expert:
            acts = {"expert": make_expert(self._run.task, self._environment), **acts}
        episodes = play_sample_episodes(
            self._environment,
            {who: self._until_stopped(act) for who, act in acts.items()},
            evaluation_seeds(self._run.seed, count),
            self._reward_model,
            self._expert,
            reference_rng(self._run.seed, self._counters.agent_steps),
            self._counters.agent_steps,
        )
        write_sample_episodes(self._directory, episodes, self._environment.metadata["render_fps"])


def _cut(video: Video, frames: int | None) -> Video:
    """Its first so many frames."""
    features = None if video.features is None else video.features[:frames]
    return replace(video, frames=video.frames[:frames], features=features)
