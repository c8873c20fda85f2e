"""That a learned reward teaches where the goal is elsewhere in every video, and one that does not see it does not.

Videos of a script in, nothing cloned, no simulator. Where the goal stays in one place, a blind reward passes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from bootifol.demos.record import record_demos
from bootifol.evaluation.returns import evaluate
from bootifol.presets import DRAWN
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.tasks import make_environment, task_named
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer
from bootifol.types import FrameStates, Rewards

TASK = "drawn_reach"
CONFIG = replace(
    DRAWN,
    threads=1,
    tracker="none",
    alignment=replace(DRAWN.alignment, gradient_steps=350),
    interactive=replace(DRAWN.interactive, agent_steps=3000),
    evaluation=replace(DRAWN.evaluation, every=10**9, sight_episodes=0),
)


class BlindReward(FrameRewardModel):
    """Rewards every frame by where things are, whatever the goal. (Not by chance: a policy that nothing teaches may as
    well go to the disc as away from it.)"""

    def score(self, states: FrameStates) -> Rewards:
        toward = np.random.default_rng(0).standard_normal(states.shape[1])
        rewards: Rewards = np.tanh(states @ toward / (127 * np.sqrt(len(toward)))).astype(np.float32)
        return rewards


@pytest.fixture(scope="module")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("moving_goals") / "demos"
    record_demos(TASK, directory, episodes=250, behaviors=["expert", "random"], pictures=CONFIG.pictures)
    return directory


def return_after_learning(demos: Path, directory: Path, blind: bool) -> float:
    run = Trainer(
        RunConfig(TASK, "bootifol", "drawn", 1, str(demos), None, CONFIG), directory, Console(quiet=True)
    )
    if blind:
        run.parts.reward_model.__class__ = BlindReward
    assert run.learn()
    environment = make_environment(TASK, CONFIG.pictures, task_named(TASK).evaluation_steps)
    agent = run.parts.agent
    results = evaluate(environment, lambda seen: agent.act(seen, 0, explore=False), range(9000, 9020))
    return float(np.mean([result.environment_return for result in results]))


def test_a_policy_learns_to_reach_a_goal_that_moves_and_a_blind_reward_does_not_teach_it(
    tmp_path: Path, demos: Path
) -> None:
    expert = task_named(TASK).expert_return
    assert expert is not None
    learned = return_after_learning(demos, tmp_path / "seeing", blind=False)
    blind = return_after_learning(demos, tmp_path / "blind", blind=True)
    assert learned > 0.6 * expert, (learned, blind)
    assert blind < 0.3 * expert, (learned, blind)
