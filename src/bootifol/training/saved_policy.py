"""What a run leaves to act with: its policy in a file of its own, and in its newest checkpoint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gymnasium

from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.policy import Policy, PolicyConfig, read_policy, write_policy
from bootifol.envs.pixels import PixelEnvironment
from bootifol.errors import BootifolError
from bootifol.hub import fetched_file, hub_address, is_hub_address
from bootifol.tasks import Task
from bootifol.training.build import Parts, build_agent, build_environment, build_reward_model
from bootifol.training.checkpoint import Progress, load_checkpoint, newest_checkpoint
from bootifol.training.run_config import RunConfig
from bootifol.types import AnyPath

NAME = "policy.safetensors"


def load_policy(run: AnyPath, trust: bool = False) -> Policy:
    """A run's newest policy, to act with outside of this library; it computes on the CPU.

    A run that acts on encodings has no `policy.safetensors` and is read from its newest checkpoint, which needs the
    environment's packages.

    Args:
        run: the run's directory, or its `policy.safetensors` alone, wherever it was copied to; or `hf://USER/NAME`, the
            address of a model on the Hugging Face hub, of which that file alone is fetched (the extra `hub`).
        trust: whether code that the run's `config.json` names may be imported; `policy.safetensors` needs none.

    Returns:
        A policy whose actions are bit for bit those of `evaluate` on the CPU.

    Raises:
        BootifolError: there is no run, it has no checkpoint yet, a file is damaged or cannot be fetched, or it names
            code that is not trusted.
    """
    if is_hub_address(run):
        return read_policy(fetched_file(hub_address(run), NAME))
    path = Path(run)
    file = path / NAME if path.is_dir() else path
    if file.is_file():
        return read_policy(file)
    config = RunConfig.read(path, trust, needs_method=False)
    config = replace(config, training=replace(config.training, device="cpu"))
    environment = build_environment(config, episode_steps=1)
    try:
        agent, progress = restored_agent(config, path, environment)
        return Policy(
            lambda observation: agent.act(observation, 0, explore=False),
            _policy_config(config, config.resolved_task(), environment, progress.counters.agent_steps),
        )
    finally:
        environment.close()


def save_policy(directory: Path, run: RunConfig, parts: Parts, agent_steps: int) -> None:
    """Writes a run's policy, unless it acts on encodings of a reward model that goes on learning.

    Args:
        directory: of the run.
        run: its configuration.
        parts: its agent, and the environment that it acts in.
        agent_steps: of training so far.
    """
    if run.training.agent.observations != "encodings":
        config = _policy_config(run, parts.task, parts.environment, agent_steps)
        write_policy(directory / NAME, config, parts.agent)


def restored_agent(run: RunConfig, directory: Path, environment: PixelEnvironment) -> tuple[DrQv2, Progress]:
    """The agent of a run's newest checkpoint, and how far it was.

    Raises:
        BootifolError: there is no checkpoint, or it is damaged or does not fit.
    """
    checkpoint = require_checkpoint(directory)
    # Others act without it, so a backbone or a module of one's own may be missing.
    reward_model = None
    if run.training.agent.observations != "pictures":
        reward_model = build_reward_model(run)
        load_checkpoint(checkpoint, {"reward_model": reward_model})
    agent = build_agent(run, environment, reward_model)
    return agent, load_checkpoint(checkpoint, {"agent": agent})


def require_checkpoint(directory: Path) -> Path:
    """A run's newest checkpoint.

    Raises:
        BootifolError: there is none.
    """
    checkpoint = newest_checkpoint(directory / "checkpoints")
    if checkpoint is None:
        raise BootifolError(f"{directory} has no checkpoint yet: let `bootifol train` write one first")
    return checkpoint


def _policy_config(
    run: RunConfig, task: Task, environment: PixelEnvironment, agent_steps: int
) -> PolicyConfig:
    assert isinstance(environment.action_space, gymnasium.spaces.Box)
    return PolicyConfig(
        task=run.task,
        agent_steps=agent_steps,
        action_dim=environment.action_space.shape[0],
        action_repeat=task.action_repeat,
        frames_per_second=environment.metadata["render_fps"],
        pictures=run.training.pictures,
    )
