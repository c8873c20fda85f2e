"""What a run measures of itself, how, and from which starts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from tiny_runs import ENDS_SOON, new_run

from bootifol import api
from bootifol.agents.drqv2 import DrQv2
from bootifol.evaluation.returns import evaluation_seeds
from bootifol.evaluation.tables import read_evaluations
from bootifol.tracking import RunLog
from bootifol.training.interactive import episode_seed
from bootifol.types import Action, Observation

TWO_ON_THE_WAY = replace(
    ENDS_SOON,
    interactive=replace(ENDS_SOON.interactive, agent_steps=150),
    evaluation=replace(ENDS_SOON.evaluation, every=60, episodes=2, long_episodes=2, final_episodes=2),
)


def test_every_evaluation_has_starts_of_its_own(tmp_path: Path, demos: Path) -> None:
    run = new_run(tmp_path / "run", demos, config=TWO_ON_THE_WAY)
    assert run.learn()
    run.evaluator.final_returns()
    starts: dict[int, list[int]] = {}
    for row in read_evaluations(tmp_path / "run" / "evaluations.csv").rows:
        if row.episode_steps == run.task.evaluation_steps:
            starts.setdefault(row.agent_steps, []).append(row.seed)
    on_the_way, final = sorted(starts)[:-1], max(starts)
    assert len(on_the_way) == 2
    assert starts[final] == evaluation_seeds(run.config.seed, 2)
    for agent_steps in on_the_way:
        assert starts[agent_steps] == evaluation_seeds(run.config.seed, 2, agent_steps)
    every = [seed for seeds in starts.values() for seed in seeds]
    trained_from = {episode_seed(run.config.seed, episode) for episode in range(10)}
    assert len({*every} | trained_from) == len(every) + 10


def test_what_is_measured_is_played_without_noise(
    tmp_path: Path, demos: Path, finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    explored: list[bool] = []
    act = DrQv2.act

    def watched(self: DrQv2, observation: Observation, agent_steps: float, explore: bool) -> Action:
        explored.append(explore)
        return act(self, observation, agent_steps, explore)

    monkeypatch.setattr(DrQv2, "act", watched)
    run = new_run(tmp_path / "run", demos, config=ENDS_SOON)
    run.log = RunLog(run.directory)
    for measure in (
        run.evaluator.returns_on_the_way,
        run.evaluator.final_returns,
        run.evaluator.sample_episodes,
        lambda: api.evaluate(finished, episodes=1),
    ):
        explored.clear()
        measure()
        assert explored and not any(explored)
