"""Builds what a run is made of, in one visible place."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from rich.console import Console

from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.encodings import FrameEncodings, StackedStates
from bootifol.agents.inverse_dynamics import InverseDynamics
from bootifol.demos.augmentation import AugmentationConfig
from bootifol.demos.check import differences
from bootifol.demos.demo_set import DemoSet, find_demo_sets
from bootifol.demos.features import FeaturizedVideos, without_pixels
from bootifol.demos.manifest import read_manifest
from bootifol.demos.record import record
from bootifol.demos.verification import Verification
from bootifol.devices import chosen_device
from bootifol.envs.pixels import PixelEnvironment
from bootifol.errors import BootifolError
from bootifol.evaluation.ranking import KINDS
from bootifol.networks.backbones import Backbone
from bootifol.replay.agent_videos import AgentVideos
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.base import EncodesFrames, Featurizer, RewardModel, SeesFrames
from bootifol.rewards.registry import make_backbone, make_reward_model
from bootifol.tasks import make_environment
from bootifol.training.checkpoint import Stateful
from bootifol.training.inferred_demonstrations import Demonstrations
from bootifol.training.run_config import RunConfig
from bootifol.types import Video, VideoSource

_VERIFY_BELOW_BYTES = 1_000_000_000


@dataclass(frozen=True)
class Demos:
    """The videos of a run."""

    expert: VideoSource
    """D_e: the expert videos that the reward learns from and agents are compared with."""
    random: VideoSource
    """Videos of a random policy, the other class of the Alignment Phase."""
    held_out: dict[str, list[Video]]
    """Videos by kind that the reward never learns from, to see whether it ranks them right."""
    augmentation: AugmentationConfig | None = None
    """How videos vary in looks when the reward learns from them; None where they do not."""
    verification: Verification = field(default_factory=Verification)
    """Of the sets that were too large to be verified on opening."""


@dataclass(frozen=True)
class Learners:
    """The networks of a run."""

    reward_model: RewardModel
    backbone: Backbone | None
    """Frozen, and so no part of a checkpoint; None where the reward model reads pixels."""
    agent: DrQv2

    @property
    def featurizer(self) -> Featurizer | None:
        """What turns the agent's frames into features or states, once; None where everything reads pixels."""
        return self.backbone or (self.reward_model if isinstance(self.reward_model, SeesFrames) else None)


@dataclass(frozen=True)
class Components(Learners):
    """The parts of a run that learn or remember."""

    replay: ReplayBuffer
    agent_videos: AgentVideos
    demonstrations: Demonstrations | None

    def stateful(self) -> dict[str, Stateful]:
        """By the names of their files in a checkpoint."""
        parts: dict[str, Stateful] = {
            "reward_model": self.reward_model,
            "agent": self.agent,
            "replay": self.replay,
            "agent_videos": self.agent_videos,
        }
        return parts if self.demonstrations is None else {**parts, "demonstrations": self.demonstrations}


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


def build_agent(
    run: RunConfig, environment: gymnasium.Env[Any, Any], reward_model: RewardModel | None
) -> DrQv2:
    """The agent, untrained. The reward model is the run's; an agent that reads pictures does not need it.

    Raises:
        BootifolError: the agent shall act on encodings, and the reward model has none for its pictures.
    """
    encodings: FrameEncodings | StackedStates | None = None
    if run.training.agent.observations == "encodings":
        encodings = _encodings(run, reward_model)
    elif run.training.agent.observations == "states":
        encodings = _states(run, reward_model)
    assert isinstance(environment.action_space, gymnasium.spaces.Box)
    pictures = run.training.pictures
    return DrQv2(
        run.training.agent,
        pictures.agent_size,
        pictures.stack,
        environment.action_space.shape[0],
        run.seed,
        chosen_device(run.training.device),
        encodings,
    )


def reads_pictures(run: RunConfig) -> bool:
    """Whether the agent's own networks read the pictures, and not what the reward model makes of them."""
    return run.training.agent.observations == "pictures"


def compares_in_time(run: RunConfig) -> bool:
    """Whether the reward compares an episode with whole videos, which must be as long then; single frames need not."""
    return run.method not in ("bootifol", "environment") or run.training.reward.bootifol.reward != "frames"


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


def _state_size(run: RunConfig, reward_model: RewardModel) -> int:
    """Numbers in the states that replay keeps; 0 where it keeps pictures."""
    if run.training.agent.observations != "states" or not isinstance(reward_model, SeesFrames):
        return 0
    return reward_model.feature_size


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


def _shift(run: RunConfig) -> int:
    """Of the pictures that replay gives out; encodings and states are of whole ones."""
    return run.training.agent.random_shift if reads_pictures(run) else 0


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
        _shift(run),
        _state_size(run, reward_model),
    )


def demonstrated_videos(run: RunConfig, expert: VideoSource) -> int:
    """How many expert videos become the agent's experience; 0 where the configuration wants none."""
    config = run.training.demonstrations
    return min(config.videos, len(expert)) if config.share > 0 else 0


def build_demonstrations(
    run: RunConfig, expert: VideoSource, action_dim: int, reward_model: RewardModel
) -> Demonstrations:
    """Expert videos as experience."""
    state_size = _state_size(run, reward_model)
    config, agent, pictures = run.training.demonstrations, run.training.agent, run.training.pictures
    frames = demonstrated_videos(run, expert) * len(expert[0].frames)
    replay = build_replay(run, reward_model, frames, action_dim)
    inverse_dynamics = InverseDynamics(
        agent.encoder,
        pictures.agent_size,
        pictures.stack,
        agent.n_step,
        action_dim,
        run.seed,
        precision=agent.precision,
        device=chosen_device(run.training.device),
        state_size=state_size,
    )
    sees = reward_model if state_size and isinstance(reward_model, SeesFrames) else None
    return Demonstrations(config, expert, replay, inverse_dynamics, pictures.agent_size, action_dim, sees)


def build_learners(run: RunConfig, environment: gymnasium.Env[Any, Any]) -> Learners:
    """The networks, untrained. They need no videos, so what cannot be built is heard of before any are read."""
    frames, capacity = run.resolved_task().episode_steps + 1, run.training.agent.replay_capacity
    if capacity < frames:
        raise BootifolError(
            f"agent.replay_capacity is {capacity:,} frames, and one episode has {frames:,}: give it many times as many"
        )
    reward_model = build_reward_model(run)
    return Learners(reward_model, build_backbone(run), build_agent(run, environment, reward_model))


def build_components(
    run: RunConfig,
    environment: gymnasium.Env[Any, Any],
    learners: Learners,
    expert: VideoSource,
    console: Console,
) -> Components:
    """Learners and stores; says how much memory the stores will take before it takes it."""
    config, pictures = run.training, run.training.pictures
    assert isinstance(environment.action_space, gymnasium.spaces.Box)
    action_dim = environment.action_space.shape[0]
    frames = run.resolved_task().episode_steps + 1
    reward_model, featurizer = learners.reward_model, learners.featurizer
    state_size = _state_size(run, reward_model)
    ring = (
        config.interactive.agent_videos,
        frames,
        pictures.video_size,
        featurizer.feature_size if featurizer else 0,
        1 if isinstance(featurizer, SeesFrames) else 4,
    )
    # The upper bound has no demonstrations: it learns from true rewards, which videos do not tell.
    demonstrated = 0 if reward_model.reads_environment_reward else demonstrated_videos(run, expert)
    size = pictures.agent_size
    replay_bytes = ReplayBuffer.bytes_needed(config.agent.replay_capacity, size, action_dim, state_size)
    video_bytes = AgentVideos.bytes_needed(*ring)
    parts = [
        f"replay {replay_bytes / 1e9:.2f} GB ({config.agent.replay_capacity:,} frames)",
        f"the agent's videos {video_bytes / 1e9:.2f} GB ({config.interactive.agent_videos:,} episodes)",
    ]
    if demonstrated:
        demonstrated_frames = demonstrated * len(expert[0].frames)
        bytes_needed = ReplayBuffer.bytes_needed(demonstrated_frames, size, action_dim, state_size)
        parts.append(f"demonstrations {bytes_needed / 1e9:.2f} GB ({demonstrated:,} videos)")
    console.print(f"memory when full: {', '.join(parts)}")
    return Components(
        reward_model=reward_model,
        backbone=learners.backbone,
        agent=learners.agent,
        replay=build_replay(run, reward_model, config.agent.replay_capacity, action_dim),
        agent_videos=AgentVideos(*ring, failures_share=config.interactive.failures_share),
        demonstrations=build_demonstrations(run, expert, action_dim, reward_model) if demonstrated else None,
    )


def open_demos(run: RunConfig, backbone: Backbone | None, console: Console) -> Demos:
    """Opens the demo sets of a run; records the random videos where there are none.

    Args:
        run: what it is.
        backbone: computes the features of the videos; None where the reward model reads pixels.
        console: where sentences go.

    Raises:
        BootifolError: there are no expert videos, or they do not match the task and the configuration.
    """
    root = Path(run.demos)
    paths = find_demo_sets(root)
    if "expert" not in paths:
        has_expert = run.resolved_task().has_expert
        raise BootifolError(
            f"there are no expert videos in {root}: "
            + (
                f"record them with `bootifol demos record --task {run.task} --out {root}` or "
                if has_expert
                else ""
            )
            + f"import your own with `bootifol demos import YOUR_VIDEOS --out {root}`"
        )
    unverified: list[DemoSet] = []
    expert = _open(paths["expert"], run, unverified)
    if "random" not in paths:
        console.print("no random videos beside the expert's; recording as many")
    if "random" not in paths or not read_manifest(paths["random"]).complete:
        paths["random"] = root / "random"
        record(
            run.task,
            "random",
            len(expert),
            paths["random"],
            run.training.pictures,
            # The same seed draws the same starts, so no start tells expert from random.
            seed=run.seed if expert.manifest.seed is None else expert.manifest.seed,
            episode_steps=expert.manifest.frames - 1,
            action_repeat=run.training.action_repeat,
        )
    held_out = min(run.training.evaluation.held_out_videos, len(expert) // 5)
    sources: dict[str, VideoSource] = {}
    kept: dict[str, list[Video]] = {}
    for kind in KINDS:
        if kind not in paths:
            continue
        demo_set = expert if kind == "expert" else _open(paths[kind], run, unverified)
        training, aside = demo_set.split(min(held_out, len(demo_set) - 1))
        if backbone is None:
            sources[kind] = training
            kept[kind] = [aside[index] for index in range(len(aside))]
            continue
        sources[kind] = featurized = FeaturizedVideos(training, backbone)
        if kind in ("expert", "random"):
            featurized.compute()
        featurized_aside = FeaturizedVideos(aside, backbone)
        kept[kind] = without_pixels(featurized_aside[index] for index in range(len(aside)))
    config = run.training.augmentation
    augments = backbone is None and config.applies(imported=expert.manifest.conversion is not None)
    if augments:
        console.print("the reward learns from videos of varying looks (augmentation)")
    return Demos(
        sources["expert"],
        sources["random"],
        kept if held_out else {},
        config if augments else None,
        Verification(unverified),
    )


def reference_rng(seed: int, agent_steps: int) -> np.random.Generator:
    """The generator that draws references for measurements, apart from the one that learning draws from."""
    return np.random.default_rng([seed, 2, agent_steps])


def _open(path: Path, run: RunConfig, unverified: list[DemoSet]) -> DemoSet:
    demo_set = DemoSet.open(path)
    if sum(shard.bytes for shard in demo_set.manifest.shards) < _VERIFY_BELOW_BYTES:
        demo_set.verify()
    else:
        unverified.append(demo_set)
    task = run.resolved_task()
    if not compares_in_time(run):
        task = replace(task, episode_steps=min(task.episode_steps, demo_set.manifest.frames - 1))
    found = differences(demo_set.manifest, task, run.training.pictures)
    if found:
        raise BootifolError(f"the videos in {path} do not fit this run: {'; '.join(found)}")
    return demo_set
