"""`bootifol experts train`: who performs where no script can."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from bootifol.errors import STOPPED


def train(
    task: str,
    out: Path | None = None,
    algorithm: Literal["SAC", "TQC", "CrossQ"] = "SAC",
    agent_steps: int = 500_000,
    seed: int = 1,
    learning_rate: float = 3e-4,
    discount: float = 0.99,
    agent_steps_per_update: int = 1,
    n_step: int = 1,
    episode_steps: int | None = None,
    target_entropy: float | None = None,
    shaping: float = 0.0,
    start_from: Path | None = None,
    threads: int = 1,
) -> int:
    """Train an expert from the simulator's states and its reward, to perform the task for recordings.

    Needs the extra `experts` (stable-baselines3). Stop it whenever you like: the same command goes on from its last
    evaluation.

    Args:
        task: What to learn; `bootifol tasks` lists the names.
        out: Directory for the policy, its curve and its checkpoint; experts/TASK by default.
        algorithm: Of stable-baselines3 and sb3-contrib.
        agent_steps: How long to train.
        seed: Of everything random.
        learning_rate: Of Adam.
        discount: Of future rewards, an agent step.
        agent_steps_per_update: Agent steps for each update of actor and critics, which takes many times as long.
        n_step: Agent steps whose rewards are summed before a critic estimates what follows.
        episode_steps: Agent steps of a training episode, by default as many as are evaluated; shorter ones show more
            starts, which is what rare rewards need.
        target_entropy: Mean entropy in nats that the noise of actions is steered to; minus the number of action
            dimensions by default. Less at the end of a training makes the mean action better.
        shaping: Weight of a potential that rises on the way to a reward which is 0 until the task is done; hopper_stand
            has one, the height of its torso. Evaluations leave it out.
        start_from: Directory of a training of the same task, algorithm and networks: begin with what it learned and
            with its replay, and go on with other settings.
        threads: Threads PyTorch computes with.
    """
    from bootifol.experts.train import ExpertConfig, train_expert

    out = out or Path("experts") / task
    config = ExpertConfig(
        task=task,
        algorithm=algorithm,
        agent_steps=agent_steps,
        seed=seed,
        learning_rate=learning_rate,
        discount=discount,
        agent_steps_per_update=agent_steps_per_update,
        n_step=n_step,
        episode_steps=episode_steps,
        target_entropy=target_entropy,
        shaping=shaping,
        threads=threads,
    )
    try:
        train_expert(config, out, start_from)
    except KeyboardInterrupt:
        print("\nstopped; run the same command again and it goes on from its last evaluation")
        return STOPPED
    print(f"{out / 'expert.safetensors'}: the best policy of those in {out / 'curve.csv'}")
    return 0
