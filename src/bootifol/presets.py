"""Presets: whole configurations, in plain Python. The command line overrides single fields of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

from bootifol.agents.config import DrQv2Config
from bootifol.demos.augmentation import AugmentationConfig
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.frames.config import FrameConfig
from bootifol.rewards.config import RewardConfig
from bootifol.rewards.context_translation.config import ContextTranslationConfig
from bootifol.rewards.gaifo.config import GaifoConfig
from bootifol.rewards.virl.config import VirlConfig
from bootifol.training.config import (
    AlignmentConfig,
    DemonstrationConfig,
    EvaluationConfig,
    InteractiveConfig,
    TrainingConfig,
)

PresetName = Literal[
    "paper",
    "cpu",
    "long",
    "demo",
    "drawn",
    "smoke",
    "backbone",
    "frames",
    "drawn_pixels",
]

PAPER = TrainingConfig(pictures=PictureConfig(profile="full"))
"""The paper's hyperparameters, which are the defaults of every field, on pictures of the simulator's own quality; what
the paper leaves open (frame drop, window, margin, warm-up, replay) is as in the authors' release (docs/bootifol.md)."""

CPU = TrainingConfig(
    pictures=PictureConfig(agent_size=64, video_size=64),
    reward=RewardConfig(
        BootifolConfig(
            width_divisor=4,
            videos_per_class=8,
            frames_per_video=4,
            precision="bf16",
            learning_rate=1e-3,
            motion=True,
            sequence_times=6,
            references=8,
            reward_scale="alignment",
        ),
        virl=VirlConfig(
            width_divisor=4,
            frames_per_video=4,
            precision="bf16",
            learning_rate=1e-3,
            references=8,
        ),
        context_translation=ContextTranslationConfig(
            width_divisor=4,
            image_weight=0.14,
            pairs=8,
            frames_per_pair=8,
            precision="bf16",
            learning_rate=1e-3,
            reward_unit="expert",
        ),
        gaifo=GaifoConfig(
            width_divisor=4, videos_per_class=16, stacks_per_video=4, precision="bf16", learning_rate=1e-3
        ),
    ),
    agent=DrQv2Config(
        encoder="strided",
        hidden_dim=512,
        batch_size=128,
        warm_up_steps=6000,
        warm_up_hold=10,
        exploration_start=0.4,
        exploration_steps=6000,
        saturation_weight=0.01,
        cloning_weight=10.0,
        ema_decay=0.999,
        replay_capacity=40_000,
        precision="bf16",
    ),
    augmentation=AugmentationConfig(when="imported"),
    alignment=AlignmentConfig(gradient_steps=500),
    interactive=InteractiveConfig(
        agent_steps=30_000,
        reward_updates_until=15_000,
        agent_videos=500,
        relabel_episodes=4,
    ),
    demonstrations=DemonstrationConfig(
        fraction=0.25, videos=3000, inverse_dynamics_updates=2000, cloning_updates=5000
    ),
    evaluation=EvaluationConfig(every=2500, long_episodes=5, final_episodes=50),
)
"""The same algorithm with smaller networks, pictures and counts: one to two hours on one core, and 8 GB.

Beyond smaller sizes it departs from the paper where the paper's choice needs more gradient steps than a CPU has:
`motion`, `sequence_times`, `references` and `reward_scale` of the reward model, `relabel_episodes`, by which stored
rewards follow it, `saturation_weight`, `ema_decay` and `cloning_weight` of the agent, `demonstrations`, by which the
policy starts as a clone of the videos, and `augmentation` where these come from files; each is described at its field.
"""

LONG = replace(
    CPU,
    agent=replace(CPU.agent, encoder="coarse", batch_size=64, update_every=10, replay_capacity=100_000),
    interactive=replace(CPU.interactive, agent_steps=1_550_000, reward_updates_until=60_000),
    evaluation=replace(CPU.evaluation, every=25_000),
)
"""`cpu` with an evening's time: the paper's 1.55M agent steps in about two and a half hours of one core, with smaller
updates and fewer of them."""

BACKBONE = TrainingConfig(
    pictures=PictureConfig(video_size=224, profile="full"),
    reward=RewardConfig(BootifolConfig(backbone="google/efficientnet-b0")),
    interactive=InteractiveConfig(agent_videos=1500),
    episode_steps=50,
)
"""The paper's Eff-BootIfOL: EfficientNet-B0, 1500 videos of 51 frames at 224x224; all else is `paper`. Its table has
one N_train for everything, 375K; the authors' released configurations stop the encoders earlier, after 60K (Button
Press), 112.5K (Plate Slide) and 350K agent steps (Drawer Close): `--interactive.reward-updates-until`."""

DRAWN_PIXELS = replace(
    CPU,
    pictures=PictureConfig(agent_size=32, video_size=32, stack=2),
    reward=RewardConfig(
        replace(CPU.reward.bootifol, width_divisor=8),
        virl=replace(CPU.reward.virl, width_divisor=8),
        context_translation=replace(CPU.reward.context_translation, width_divisor=8, image_weight=0.28),
        gaifo=replace(CPU.reward.gaifo, width_divisor=8),
    ),
    agent=replace(
        CPU.agent,
        hidden_dim=128,
        batch_size=64,
        warm_up_steps=600,
        warm_up_hold=1,
        exploration_start=1.0,
        exploration_steps=2250,
        replay_capacity=10_000,
        learning_rate=5e-4,
        discount=0.9,
        tau=0.02,
        random_shift=2,
        saturation_weight=0.1,
        cloning_weight=0.0,
        ema_decay=0.0,
    ),
    demonstrations=DemonstrationConfig(),
    alignment=AlignmentConfig(gradient_steps=150, time_fraction=0.25, log_every=10),
    interactive=InteractiveConfig(
        agent_steps=4500, reward_updates_until=850, agent_videos=150, relabel_episodes=4, log_every=200
    ),
    evaluation=EvaluationConfig(
        every=500, episodes=5, long_episodes=5, final_episodes=50, held_out_videos=16
    ),
)
"""For the tasks drawn with numpy, at 32 pixels: a policy from videos in two minutes, without a simulator and
with nothing cloned. The learning test runs it. N_train is the fraction of the paper's 100K agent steps, the best of its
four here (docs/results/drawn_home.md)."""

SMOKE = replace(
    CPU,
    reward=RewardConfig(
        replace(CPU.reward.bootifol, width_divisor=16, videos_per_class=4),
        virl=replace(CPU.reward.virl, width_divisor=16, videos_per_class=4),
        context_translation=replace(
            CPU.reward.context_translation, width_divisor=16, pairs=4, image_weight=0.035
        ),
        gaifo=replace(CPU.reward.gaifo, width_divisor=16, videos_per_class=4),
    ),
    agent=replace(
        CPU.agent,
        hidden_dim=64,
        batch_size=32,
        warm_up_steps=240,
        exploration_steps=1000,
        replay_capacity=3000,
    ),
    alignment=AlignmentConfig(gradient_steps=60, log_every=5),
    interactive=replace(
        CPU.interactive, agent_steps=900, reward_updates_until=600, agent_videos=50, log_every=150
    ),
    demonstrations=replace(
        CPU.demonstrations, videos=20, inverse_dynamics_updates=30, cloning_updates=30, phases=1
    ),
    evaluation=EvaluationConfig(
        every=450,
        episodes=1,
        long_episodes=1,
        final_episodes=2,
        held_out_videos=6,
        showcase_episodes=2,
        sight_episodes=1,
    ),
)
"""Every stage in under two minutes. It learns nothing worth having."""


def _seeing(pixels: TrainingConfig, frames: FrameConfig, **agent: Any) -> TrainingConfig:
    """The same with a reward from single frames, whose eyes the agent shares."""
    return replace(
        pixels,
        reward=replace(
            pixels.reward, bootifol=replace(pixels.reward.bootifol, reward="frames", frames=frames)
        ),
        agent=replace(
            pixels.agent,
            observations="states",
            critic_norm=True,
            feature_dim=64,
            precision="fp32",
            **agent,
        ),
    )


FRAMES = _seeing(
    CPU,
    FrameConfig(),
    hidden_dim=256,
    batch_size=256,
    learning_rate=3e-4,
    discount=0.95,
    replay_capacity=300_000,
    warm_up_steps=3000,
    exploration_start=1.0,
    exploration_steps=20_000,
    cloning_weight=0.0,
)
FRAMES = replace(
    FRAMES,
    alignment=AlignmentConfig(gradient_steps=2000),
    interactive=InteractiveConfig(
        agent_steps=100_000, reward_update_every=8, reward_updates_until=48_000, agent_videos=1000
    ),
    demonstrations=DemonstrationConfig(
        fraction=0.25, inverse_dynamics_updates=1000, cloning_updates=0, phases=20, repeat_every=2000
    ),
    evaluation=replace(CPU.evaluation, every=10_000),
)
"""`cpu` with a reward from single frames, and an agent that reads what its eyes make of them. Nothing is cloned; a
quarter of every batch comes from the expert videos, with inferred actions."""

DEMO = replace(
    FRAMES,
    alignment=AlignmentConfig(gradient_steps=1500, time_fraction=0.3),
    interactive=replace(FRAMES.interactive, agent_steps=60_000, agent_videos=500),
    demonstrations=replace(FRAMES.demonstrations, time_fraction=0.15),
    evaluation=EvaluationConfig(every=10_000, long_episodes=1, final_episodes=10),
    checkpoint_minutes=5.0,
)
"""For `make demo`: `frames` in minutes."""

DRAWN = _seeing(DRAWN_PIXELS, FrameConfig(late_from=0.0, noise=0.05), replay_capacity=20_000)
DRAWN = replace(
    DRAWN,
    alignment=AlignmentConfig(gradient_steps=1000, time_fraction=0.5),
    interactive=InteractiveConfig(
        agent_steps=8000,
        reward_update_every=8,
        reward_updates_until=8000,
        agent_videos=300,
        log_every=500,
    ),
    evaluation=replace(DRAWN.evaluation, every=1000),
)
"""For the tasks drawn with numpy, at 32 pixels: a policy from videos in minutes, without a simulator and with nothing
cloned. The learning test runs it."""

PRESETS: dict[PresetName, TrainingConfig] = {
    "paper": PAPER,
    "cpu": CPU,
    "long": LONG,
    "demo": DEMO,
    "drawn": DRAWN,
    "smoke": SMOKE,
    "backbone": BACKBONE,
    "frames": FRAMES,
    "drawn_pixels": DRAWN_PIXELS,
}


SEEING_METHODS = ("bootifol", "environment")
"""Methods whose reward has eyes that an agent can share."""

WITHOUT_EYES = {"drawn": "drawn_pixels", "frames": "cpu", "demo": "cpu"}
"""What other methods get in place of a preset whose agent reads what the reward's eyes make of a frame."""


def preset(name: str, method: str = "bootifol") -> TrainingConfig:
    """A preset's configuration, frozen: `dataclasses.replace`, or `overrides` of `bootifol.train`, change it.

    Args:
        name: of the preset: paper, cpu, long, frames, backbone, drawn, drawn_pixels, demo or smoke.
        method: whose run it is for. One whose reward has no eyes gets another in its place (`WITHOUT_EYES`).

    Raises:
        BootifolError: there is none of that name.
    """
    if method not in SEEING_METHODS:
        name = WITHOUT_EYES.get(name, name)
    for known, config in PRESETS.items():
        if known == name:
            return config
    raise BootifolError(f"there is no preset '{name}'; the presets are {', '.join(PRESETS)}")
