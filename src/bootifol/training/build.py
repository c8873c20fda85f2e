"""Builds what a run is made of, in one visible place: every part that the paper's Algorithm 1 names."""

from __future__ import annotations

from dataclasses import dataclass

import gymnasium
from rich.console import Console

from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.encodings import FrameEncodings, StackedStates
from bootifol.agents.inverse_dynamics import InverseDynamics
from bootifol.devices import chosen_device
from bootifol.envs.pixels import PixelEnvironment
from bootifol.errors import BootifolError
from bootifol.networks.backbones import Backbone
from bootifol.replay.agent_videos import AgentVideos
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.base import EncodesFrames, Featurizer, RewardModel, SeesFrames
from bootifol.rewards.registry import make_backbone, make_reward_model
from bootifol.tasks import Task, make_environment
from bootifol.training.checkpoint import Stateful
from bootifol.training.inferred_demonstrations import Demonstrations
from bootifol.training.open_demos import Demos, open_demos
from bootifol.training.run_config import RunConfig
from bootifol.types import OtherCamera


@dataclass(frozen=True)
class Parts:
    """What a run is made of."""

    task: Task
    """With the lengths of the run's episodes."""
    environment: PixelEnvironment
    """env."""
    demos: Demos
    """D_e, and the other videos."""
    reward_model: RewardModel
    """f, g, q, d."""
    featurizer: Featurizer | None
    """What turns frames into features or states, once: a frozen backbone, or the reward model's eyes. None where
    everything reads pixels."""
    agent: DrQv2
    """π, Q."""
    replay: ReplayBuffer
    """D."""
    agent_videos: AgentVideos
    """D_a."""
    demonstrations: Demonstrations | None
    """Expert videos as experience, beyond the paper; None without them."""

    def stateful(self) -> dict[str, Stateful]:
        """What learns or remembers, by the names of the files in a checkpoint."""
        parts: dict[str, Stateful] = {
            "reward_model": self.reward_model,
            "agent": self.agent,
            "replay": self.replay,
            "agent_videos": self.agent_videos,
        }
        return parts if self.demonstrations is None else {**parts, "demonstrations": self.demonstrations}


def build_parts(run: RunConfig, task: Task, console: Console, demos: Demos | None = None) -> Parts:
    """Builds every part, untrained; says how much memory the stores will take before it takes it.

    Args:
        run: what it is.
        task: the run's, resolved.
        console: where sentences go.
        demos: videos instead of the run's own, which are opened otherwise.

    Raises:
        BootifolError: the configuration or the videos cannot be used.
    """
    config, pictures = run.training, run.training.pictures
    environment = build_environment(run, task.episode_steps)
    assert isinstance(environment.action_space, gymnasium.spaces.Box)
    action_dim = environment.action_space.shape[0]
    episode_frames, capacity = task.episode_steps + 1, config.agent.replay_capacity
    if capacity < episode_frames:
        raise BootifolError(
            f"agent.replay_capacity is {capacity:,} frames, and one episode has {episode_frames:,}: give it many times "
            "as many"
        )

    # The networks f, g, q, d and π, Q. They need no videos, so what cannot be built is heard of before any are read.
    reward_model = build_reward_model(run)
    backbone = build_backbone(run)
    featurizer = backbone or (reward_model if isinstance(reward_model, SeesFrames) else None)
    agent = build_agent(run, environment, reward_model)

    # D_e, and videos of a random policy.
    if demos is None:
        demos = open_demos(run, task, backbone, console)
    # The upper bound has no demonstrations: it learns from true rewards, which videos do not tell.
    demonstrated = (
        min(config.demonstrations.videos, len(demos.expert)) if config.demonstrations.fraction > 0 else 0
    )
    if reward_model.reads_environment_reward:
        demonstrated = 0
    if demonstrated and not config.demonstrations.clones and isinstance(demos.random, OtherCamera):
        console.print(
            "the expert's videos are of another camera, and as the agent's experience they may mislead it: "
            "--demonstrations.fraction 0 leaves that out"
        )
    demonstrated_frames = demonstrated * len(demos.expert[0].frames) if demonstrated else 0

    # The stores D and D_a, empty, and expert videos as experience.
    size, state_size = pictures.agent_size, _state_size(run, reward_model)
    ring = (
        config.interactive.agent_videos,
        episode_frames,
        pictures.video_size,
        featurizer.feature_size if featurizer else 0,
        1 if isinstance(featurizer, SeesFrames) else 4,
    )
    replay_bytes = ReplayBuffer.bytes_needed(capacity, size, action_dim, state_size)
    memory = [
        f"replay {replay_bytes / 1e9:.2f} GB ({capacity:,} frames)",
        f"the agent's videos {AgentVideos.bytes_needed(*ring) / 1e9:.2f} GB ({ring[0]:,} episodes)",
    ]
    if demonstrated:
        shown_bytes = ReplayBuffer.bytes_needed(demonstrated_frames, size, action_dim, state_size)
        memory.append(f"demonstrations {shown_bytes / 1e9:.2f} GB ({demonstrated:,} videos)")
    console.print(f"memory when full: {', '.join(memory)}")
    demonstrations = None
    replay = build_replay(run, reward_model, capacity, action_dim)
    agent_videos = AgentVideos(*ring)
    if demonstrated:
        demonstrations = Demonstrations(
            config.demonstrations,
            demos.expert,
            build_replay(run, reward_model, demonstrated_frames, action_dim),
            InverseDynamics(
                config.agent.encoder,
                size,
                pictures.stack,
                config.agent.n_step,
                action_dim,
                run.seed,
                precision=config.agent.precision,
                device=chosen_device(config.device),
                state_size=state_size,
            ),
            size,
            action_dim,
            reward_model if state_size and isinstance(reward_model, SeesFrames) else None,
        )
    return Parts(
        task, environment, demos, reward_model, featurizer, agent, replay, agent_videos, demonstrations
    )


def build_environment(run: RunConfig, episode_steps: int) -> PixelEnvironment:
    """An environment of the run's task that shows it as the run's configuration says."""
    return make_environment(run.task, run.training.pictures, episode_steps, run.training.action_repeat)


def build_reward_model(run: RunConfig) -> RewardModel:
    """The method's reward model, untrained."""
    config = run.training
    device = chosen_device(config.device)
    return make_reward_model(run.method, config.reward, config.pictures.video_size, run.seed, device)


def build_backbone(run: RunConfig) -> Backbone | None:
    """The frozen network whose features the reward model reads; None where it reads pixels."""
    config = run.training
    return make_backbone(run.method, config.reward, config.pictures.video_size, chosen_device(config.device))


def build_agent(run: RunConfig, environment: PixelEnvironment, reward_model: RewardModel | None) -> DrQv2:
    """The agent, untrained.

    Args:
        run: what it is.
        environment: that it acts in.
        reward_model: the run's; an agent that reads pictures does not need it.

    Raises:
        BootifolError: the agent shall act on encodings or states, and the reward model has none for its pictures.
    """
    config, pictures = run.training, run.training.pictures
    encodings: FrameEncodings | StackedStates | None = None
    if config.agent.observations == "encodings":
        encodings = _encodings(run, reward_model)
    elif config.agent.observations == "states":
        encodings = _states(run, reward_model)
    assert isinstance(environment.action_space, gymnasium.spaces.Box)
    return DrQv2(
        config.agent,
        pictures.agent_size,
        pictures.stack,
        environment.action_space.shape[0],
        run.seed,
        chosen_device(config.device),
        encodings,
    )


def build_replay(run: RunConfig, reward_model: RewardModel, capacity: int, action_dim: int) -> ReplayBuffer:
    """An empty replay of so many frames, of what the run's agent sees."""
    agent, pictures = run.training.agent, run.training.pictures
    return ReplayBuffer(
        capacity,
        pictures.agent_size,
        action_dim,
        pictures.stack,
        agent.n_step,
        agent.discount,
        # Of the pictures that replay gives out; encodings and states are of whole ones.
        agent.random_shift if agent.observations == "pictures" else 0,
        _state_size(run, reward_model),
    )


def _state_size(run: RunConfig, reward_model: RewardModel) -> int:
    """Numbers in the states that replay keeps; 0 where it keeps pictures."""
    if run.training.agent.observations != "states" or not isinstance(reward_model, SeesFrames):
        return 0
    return reward_model.feature_size


def _states(run: RunConfig, reward_model: RewardModel | None) -> StackedStates:
    if not isinstance(reward_model, SeesFrames):
        raise BootifolError(
            f"agent.observations states needs a reward model with eyes, which {run.method} as configured has not: "
            "choose --method bootifol with --reward.bootifol.reward frames, or --agent.observations pictures"
        )
    pictures = run.training.pictures
    if pictures.agent_size != pictures.video_size:
        raise BootifolError(
            f"agent.observations states needs pictures of one size for agent and reward, not {pictures.agent_size} "
            f"and {pictures.video_size}: pass --pictures.agent-size {pictures.video_size}"
        )
    return StackedStates(reward_model.eyes, pictures.stack)


def _encodings(run: RunConfig, reward_model: RewardModel | None) -> FrameEncodings:
    pictures = run.training.pictures
    if not isinstance(reward_model, EncodesFrames):
        raise BootifolError(
            f"agent.observations encodings needs a method that encodes single frames, which {run.method} does not: "
            "choose --method bootifol, or --agent.observations pictures"
        )
    if build_backbone(run) is not None:
        raise BootifolError(
            "agent.observations encodings does not go with a backbone, which would read every picture of every batch "
            "anew: choose --agent.observations pictures, or no backbone"
        )
    if pictures.agent_size < pictures.video_size:
        raise BootifolError(
            f"the agent's pictures have {pictures.agent_size} pixels, too few for the reward model to encode, which "
            f"reads {pictures.video_size}: pass --pictures.agent-size {pictures.video_size}"
        )
    return FrameEncodings(reward_model, pictures.stack)
