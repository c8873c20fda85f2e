"""Everything a run can be told, as frozen dataclasses; a field's docstring is its help text."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from pydantic import Field, Strict

from bootifol.agents.config import DrQv2Config
from bootifol.demos.augmentation import AugmentationConfig
from bootifol.devices import check_device_name
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import LONGEST_EPISODE
from bootifol.rewards.config import RewardConfig
from bootifol.settings import BelowOne, Count, CountOrZero, Fraction, Positive, Threads, settings
from bootifol.tracking import TrackerName

Steps = Annotated[int, Strict(), Field(ge=1, le=LONGEST_EPISODE)]


@dataclass(frozen=True)
@settings("alignment")
class AlignmentConfig:
    """Alignment Phase: the reward learns to tell expert from random videos before the agent acts."""

    gradient_steps: CountOrZero = 8000
    """N_pretrain of Algorithm 1."""

    time_fraction: Fraction = 0.15
    """With a time budget, the largest fraction of it that this phase may take."""

    log_every: Count = 20
    """Gradient steps a line of metrics averages over."""


@dataclass(frozen=True)
@settings("interactive")
class InteractiveConfig:
    """Interactive Phase: the agent acts and learns, and its episodes bootstrap the reward."""

    agent_steps: CountOrZero = 1_550_000
    """N_π: agent steps in all (one agent step is `action_repeat` environment frames)."""

    reward_update_every: Count = 50
    """N_update: agent steps between two gradient steps of the reward."""

    reward_updates_until: CountOrZero = 375_000
    """N_train: agent steps after which the reward is frozen. Methods whose own paper trains the reward until the run
    ends do so here too."""

    agent_videos: Count = 5000
    """Capacity of D_a: how many of the agent's newest episodes the reward learns from."""

    relabel_episodes: CountOrZero = 0
    """Stored episodes rewarded anew after each update of the reward, drawn at random among those still in replay; 0 as
    in the paper, whose stored rewards go stale. Not read where replay keeps states, which are all rewarded anew."""

    log_every: Count = 1000
    """Agent steps a line of metrics averages over."""


@dataclass(frozen=True)
@settings("demonstrations")
class DemonstrationConfig:
    """Expert videos as the agent's experience (beyond the paper)."""

    fraction: BelowOne = 0.0
    """Fraction of each batch that is drawn from expert videos; 0, as in the paper, uses none."""

    videos: Count = 1000
    """Expert videos used so, at most; they take replay's memory a second time."""

    inverse_dynamics_updates: Count = 1500
    """Gradient steps of the inverse dynamics in each Cloning Phase; the first comes when the agent's warm-up ends."""

    cloning_updates: CountOrZero = 4000
    """Gradient steps of encoder and actor towards the inferred actions in each Cloning Phase; with 0 nothing is cloned,
    and the videos are experience alone."""

    phases: Count = 3
    """Cloning Phases of a run."""

    time_fraction: Fraction = 0.25
    """With a time budget, the largest fraction of it that all Cloning Phases together may take, each as much as any
    other: what is left of its gradient steps then is left out."""

    repeat_every: Count = 1500
    """Agent steps from one Cloning Phase to the next: steps of a policy that moves like the expert teach the inverse
    dynamics what random ones cannot, and every demonstration gets its actions and rewards anew."""

    @property
    def clones(self) -> bool:
        """Whether Cloning Phases make a clone, or infer actions alone."""
        return self.cloning_updates > 0


@dataclass(frozen=True)
@settings("evaluation")
class EvaluationConfig:
    """When and how the policy is measured. Nothing measured here reaches a learner."""

    every: Count = 25_000
    """Agent steps between two evaluations during training."""

    episodes: CountOrZero = 5
    """Episodes each time, of the task's training length (60 agent steps), as the paper's curves."""

    long_episodes: CountOrZero = 2
    """Episodes each time of the task's evaluation length (500 agent steps), as the paper's tables."""

    final_episodes: Count = 50
    """Episodes of the evaluation length when training has ended."""

    held_out_videos: CountOrZero = 32
    """Expert videos that the reward never learns from, kept to see whether it ranks them right."""

    sight_episodes: CountOrZero = 8
    """Episodes of the expert, and of each kind of plausible failure, by which the learned reward is judged after
    alignment and at the end (docs/frames.md); 0 for none. Only for tasks of the catalogue that have an expert."""

    showcase_episodes: CountOrZero = 3
    """Starts from which expert, agent and random play for the report's videos and film strips."""


@dataclass(frozen=True)
@settings("")
class TrainingConfig:
    """All of a run's configuration."""

    pictures: PictureConfig = field(default_factory=PictureConfig)
    reward: RewardConfig = field(default_factory=RewardConfig)
    agent: DrQv2Config = field(default_factory=DrQv2Config)
    augmentation: AugmentationConfig = field(default_factory=AugmentationConfig)
    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    interactive: InteractiveConfig = field(default_factory=InteractiveConfig)
    demonstrations: DemonstrationConfig = field(default_factory=DemonstrationConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)

    action_repeat: Steps | None = None
    """Simulator steps an agent step, instead of the task's own (1 for Gymnasium environments). Episodes then last as
    long in simulator steps as before."""

    episode_steps: Steps | None = None
    """Agent steps of a training episode, instead of the task's own (for Gymnasium environments their time limit, or
    200). The videos must be one frame longer at least."""

    evaluation_steps: Steps | None = None
    """Agent steps of an evaluation episode, instead of the task's own."""

    device: str = "auto"
    """Where networks compute: auto (a CUDA GPU where PyTorch sees one, else the CPU), cpu, cuda, cuda:NUMBER, or mps on
    a Mac. None but the CPU has been tried."""

    threads: Threads = 1
    """Threads PyTorch computes with; docs/performance.md says when more than one pays."""

    checkpoint_minutes: Positive = 20.0
    """Minutes between two checkpoints; one is also written at the end and when the run is interrupted."""

    tracker: TrackerName = "tensorboard"
    """Where metrics go beside metrics.jsonl. tensorboard: event files in the run, where TensorBoard is installed.
    wandb: Weights & Biases (extra `wandb`), with the showcase's videos and the report; WANDB_MODE=offline keeps all of
    it in the run. none: nowhere else."""

    def __post_init__(self) -> None:
        check_device_name(self.device)
