"""What was learned, for the eye: expert, agent and random from the same starts, and the reward along them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from bootifol.envs.rollout import Act, play_episode
from bootifol.files import write_arrays
from bootifol.rewards.base import RewardModel
from bootifol.rewards.references import draw_references
from bootifol.types import Arrays, Frames, Rewards, VideoSource
from bootifol.video_files.writing import write_video


@dataclass(frozen=True)
class SampleEpisode:
    """One episode to look at."""

    kind: str
    """Who acts: expert, agent or random."""

    start: int
    """Number of the start, from 0; episodes of one start begin in the same state."""

    seed: int
    """The seed of that start."""

    frames: Frames
    """uint8 `[T + 1, H, W, 3]`, the larger of the sizes the agent and the reward model read."""

    rewards: Rewards
    """The learned reward, float32 `[T]`."""

    environment_return: float


def play_sample_episodes(
    environment: gymnasium.Env[Any, Any],
    acts: Mapping[str, Act],
    seeds: Sequence[int],
    model: RewardModel,
    expert: VideoSource,
    rng: np.random.Generator,
    agent_steps: int,
) -> list[SampleEpisode]:
    """Plays every actor from every start and rewards each episode.

    Episodes of one start are compared with the same references, so that their rewards can be compared.

    Args:
        environment: episodes no longer than the expert videos.
        acts: policies by kind (expert, agent, random).
        seeds: one per start.
        model: the learned reward.
        expert: the expert videos from which references are drawn.
        rng: draws the references.
        agent_steps: training so far; part of the videos' names.
    """
    episodes: list[SampleEpisode] = []
    for start, seed in enumerate(seeds):
        references = draw_references(model, expert, rng)
        for kind, act in acts.items():
            played = play_episode(
                environment,
                act,
                seed,
                f"showcase-{agent_steps}-{kind}-{start}",
                keep_environment_rewards=model.reads_environment_reward,
            )
            episodes.append(
                SampleEpisode(
                    kind=kind,
                    start=start,
                    seed=seed,
                    frames=played.episode.largest_frames,
                    rewards=np.asarray(model.label(played.episode.video, references), dtype=np.float32),
                    environment_return=played.environment_return,
                )
            )
    return episodes


def write_sample_episodes(
    run_dir: Path, episodes: Sequence[SampleEpisode], frames_per_second: float = 20.0
) -> None:
    """Writes `showcase.safetensors` and `videos/<kind>-<start>.mp4` into a run directory.

    Keys: `frames/<kind>/<start>` uint8 `[T + 1, H, W, 3]`, `reward/<kind>/<start>` float32 `[T]`,
    `environment_return/<kind>/<start>` and `seed/<kind>/<start>`, both `[1]`.
    """
    arrays: Arrays = {}
    for episode in episodes:
        name = f"{episode.kind}/{episode.start}"
        arrays[f"frames/{name}"] = episode.frames
        arrays[f"reward/{name}"] = episode.rewards
        arrays[f"environment_return/{name}"] = np.array([episode.environment_return], dtype=np.float64)
        arrays[f"seed/{name}"] = np.array([episode.seed], dtype=np.int64)
    write_arrays(run_dir / "showcase.safetensors", arrays)
    for episode in episodes:
        write_video(
            run_dir / "videos" / f"{episode.kind}-{episode.start}.mp4", episode.frames, frames_per_second
        )
