"""The real thing, small: videos of a script in, a policy out that imitates it. No simulator, no reward given.

The whole method runs as in Algorithm 1 on a task drawn with numpy. The policy must return what random actions, an
agent that never learned and an agent on shuffled rewards cannot.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from bootifol.demos.record import record_demos
from bootifol.envs.pictures import PictureConfig
from bootifol.envs.rollout import Act
from bootifol.evaluation.returns import evaluate
from bootifol.experts import make_random
from bootifol.presets import CPU
from bootifol.rewards.registry import RewardConfig
from bootifol.tasks import make_environment, task_named
from bootifol.training.config import AlignmentConfig, InteractiveConfig, TrainingConfig
from bootifol.training.run_config import RunConfig
from bootifol.training.train import Run
from bootifol.types import Rewards

TASK = "drawn_home"
PICTURES = PictureConfig(agent_size=32, video_size=32, stack=2)
AGENT_STEPS = 6000

CONFIG: TrainingConfig = replace(
    CPU,
    pictures=PICTURES,
    threads=1,
    tensorboard=False,
    reward=RewardConfig(replace(CPU.reward.bootifol, width_divisor=8)),
    agent=replace(
        CPU.agent,
        encoder="strided",
        hidden_dim=128,
        batch_size=64,
        warm_up_steps=600,
        exploration_steps=AGENT_STEPS // 2,
        replay_capacity=AGENT_STEPS + 1000,
        learning_rate=5e-4,
        discount=0.9,
        target_rate=0.02,
        shift=2,
    ),
    alignment=AlignmentConfig(gradient_steps=120),
    interactive=InteractiveConfig(
        agent_steps=AGENT_STEPS, reward_update_every=60, reward_updates_until=AGENT_STEPS, agent_videos=300
    ),
    evaluation=replace(CPU.evaluation, every=10**9, held_out_videos=16),
)


def learned(directory: Path, demos: Path) -> Run:
    return Run(
        RunConfig(TASK, "bootifol", "cpu", 1, str(demos), None, CONFIG), directory, Console(quiet=True)
    )


def mean_return(act: Act) -> float:
    """Over 20 episodes of the task's evaluation length."""
    environment = make_environment(TASK, PICTURES, task_named(TASK).evaluation_steps)
    results = evaluate(environment, act, range(9000, 9020))
    return float(np.mean([result.environment_return for result in results]))


def return_of(run: Run) -> float:
    agent = run.components.agent
    return mean_return(lambda observation: agent.act(observation, AGENT_STEPS, explore=False))


@pytest.fixture(scope="module")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("learning") / "demos"
    record_demos(TASK, directory, episodes=150, pictures=PICTURES)
    return directory


def test_videos_in_policy_out(tmp_path: Path, demos: Path) -> None:
    task = task_named(TASK)
    run = learned(tmp_path / "run", demos)
    frozen = return_of(run)
    random = mean_return(make_random(run.environment, seed=0))
    assert run.learn()
    reached = return_of(run)

    shuffled = learned(tmp_path / "shuffled", demos)
    label = shuffled.components.reward_model.label
    rng = np.random.default_rng(0)

    def shuffled_label(*arguments: object) -> Rewards:
        rewards: Rewards = rng.permutation(label(*arguments)) * rng.choice([-1.0, 1.0])
        return rewards.astype(np.float32)

    shuffled.components.reward_model.label = shuffled_label  # type: ignore[method-assign]
    assert shuffled.learn()
    misled = return_of(shuffled)

    print(f"return {reached:.1f}; shuffled {misled:.1f}, frozen {frozen:.1f}, random {random:.1f}")
    halfway = (task.expert_return + task.random_return) / 2
    assert reached > halfway
    assert max(misled, frozen, random) < halfway
