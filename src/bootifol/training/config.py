"""Everything a run can be told, as frozen dataclasses; a field's docstring is its help text."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

from bootifol.agents.config import DrQv2Config
from bootifol.demos.augmentation import AugmentationConfig
from bootifol.devices import check_device_name
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import (
    LONGEST_EPISODE,
    MOST_THREADS,
    BootifolError,
    fields_of,
    require_at_least,
    require_at_most,
    require_below_one,
    require_choices,
    require_fraction,
    require_positive,
    require_reasonable,
)
from bootifol.rewards.config import RewardConfig
from bootifol.tracking import TrackerName


@dataclass(frozen=True)
class AlignmentConfig:
    """Alignment Phase: the reward learns to tell expert from random videos before the agent acts."""

    gradient_steps: int = 8000
    """N_pretrain of Algorithm 1."""

    time_fraction: float = 0.15
    """With a time budget, the largest fraction of it that this phase may take."""

    log_every: int = 20
    """Gradient steps a line of metrics averages over."""

    def __post_init__(self) -> None:
        require_at_least(0, gradient_steps=self.gradient_steps)
        require_fraction(**fields_of("alignment", self, "time_fraction"))
        require_at_least(1, log_every=self.log_every)


@dataclass(frozen=True)
class InteractiveConfig:
    """Interactive Phase: the agent acts and learns, and its episodes bootstrap the reward."""

    agent_steps: int = 1_550_000
    """N_π: agent steps in all (one agent step is `action_repeat` environment frames)."""

    reward_update_every: int = 50
    """N_update: agent steps between two gradient steps of the reward."""

    reward_updates_until: int = 375_000
    """N_train: agent steps after which the reward is frozen. Methods whose own paper trains the reward until the run
    ends do so here too."""

    agent_videos: int = 5000
    """Capacity of D_a: how many of the agent's newest episodes the reward learns from."""

    failures_fraction: float = 1.0
    """Beyond the paper: fraction of the agent's videos, those of the lowest learned reward, that the reward learns from
    as the other class; 1, as in the paper, all. The better the agent gets, the more of all are successes, and a reward
    that learns to tell them from the expert's spoils the policy."""

    relabel_episodes: int = 0
    """Stored episodes rewarded anew after each update of the reward, drawn at random among those still in replay; 0 as
    in the paper, whose stored rewards go stale."""

    relabel_every: int = 100
    """Where replay keeps states: updates of the reward after which every stored step is rewarded anew, which takes a
    fraction of a second. `relabel_episodes` is not read then."""

    log_every: int = 1000
    """Agent steps a line of metrics averages over."""

    def __post_init__(self) -> None:
        require_at_least(
            0,
            agent_steps=self.agent_steps,
            reward_updates_until=self.reward_updates_until,
            relabel_episodes=self.relabel_episodes,
        )
        if not 0 < self.failures_fraction <= 1:
            raise BootifolError(
                f"interactive.failures_fraction must be above 0 and at most 1, not {self.failures_fraction}"
            )
        require_at_least(
            1,
            reward_update_every=self.reward_update_every,
            agent_videos=self.agent_videos,
            relabel_every=self.relabel_every,
            log_every=self.log_every,
        )


@dataclass(frozen=True)
class DemonstrationConfig:
    """Expert videos as the agent's experience (beyond the paper)."""

    fraction: float = 0.0
    """Fraction of each batch that is drawn from expert videos; 0, as in the paper, uses none."""

    videos: int = 1000
    """Expert videos used so, at most; they take replay's memory a second time."""

    moving_fraction: float = 0.8
    """Fraction of the transitions drawn from expert videos in which the picture moves."""

    history_dropout: float = 0.8
    """Fraction of the observations drawn from expert videos whose stack repeats its newest frame."""

    policy_fraction: float = 0.5
    """Fraction of the inverse dynamics' batches from steps after the warm-up, as soon as there are any: the policy
    moves more like the expert than random actions do. The rest comes from all steps."""

    inverse_dynamics_updates: int = 1500
    """Gradient steps of the inverse dynamics in each Cloning Phase; the first comes when the agent's warm-up ends."""

    inverse_dynamics_learning_rate: float = 5e-4
    """Of Adam at its highest: in each phase it rises for a twentieth of the gradient steps and falls to 0."""

    cloning_updates: int = 4000
    """Gradient steps of encoder and actor towards the inferred actions in each Cloning Phase."""

    cloning_learning_rate: float = 1e-3
    """Of Adam at its highest, rising and falling likewise."""

    phases: int = 3
    """Cloning Phases of a run."""

    time_fraction: float = 0.25
    """With a time budget, the largest fraction of it that all Cloning Phases together may take, each as much as any
    other: what is left of its gradient steps then is left out."""

    repeat_every: int = 1500
    """Agent steps from one Cloning Phase to the next: steps of a policy that moves like the expert teach the inverse
    dynamics what random ones cannot, and every demonstration gets its actions and rewards anew."""

    batch_size: int = 128
    """Transitions of a gradient step of the inverse dynamics."""

    def __post_init__(self) -> None:
        of_self = partial(fields_of, "demonstrations", self)
        require_below_one(**of_self("fraction"))
        require_fraction(**of_self("moving_fraction", "history_dropout", "policy_fraction", "time_fraction"))
        counts = ("videos", "inverse_dynamics_updates", "phases", "repeat_every", "batch_size")
        require_at_least(1, **of_self(*counts))
        require_at_least(0, **of_self("cloning_updates"))
        require_positive(**of_self("inverse_dynamics_learning_rate", "cloning_learning_rate"))


@dataclass(frozen=True)
class EvaluationConfig:
    """When and how the policy is measured. Nothing measured here reaches a learner."""

    every: int = 25_000
    """Agent steps between two evaluations during training."""

    episodes: int = 5
    """Episodes each time, of the task's training length (60 agent steps), as the paper's curves."""

    long_episodes: int = 2
    """Episodes each time of the task's evaluation length (500 agent steps), as the paper's tables."""

    final_episodes: int = 50
    """Episodes of the evaluation length when training has ended."""

    held_out_videos: int = 32
    """Expert videos that the reward never learns from, kept to see whether it ranks them right."""

    sight_episodes: int = 8
    """Episodes of the expert, and of each kind of plausible failure, by which the learned reward is judged after
    alignment and at the end (docs/frames.md); 0 for none. Only for tasks of the catalogue that have an expert."""

    showcase_episodes: int = 3
    """Starts from which expert, agent and random play for the report's videos and film strips."""

    def __post_init__(self) -> None:
        require_at_least(1, every=self.every, final_episodes=self.final_episodes)
        require_at_least(0, episodes=self.episodes, long_episodes=self.long_episodes)
        require_at_least(0, held_out_videos=self.held_out_videos, showcase_episodes=self.showcase_episodes)
        require_at_least(0, sight_episodes=self.sight_episodes)


@dataclass(frozen=True)
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

    action_repeat: int | None = None
    """Simulator steps an agent step, instead of the task's own (1 for Gymnasium environments). Episodes then last as
    long in simulator steps as before."""

    episode_steps: int | None = None
    """Agent steps of a training episode, instead of the task's own (for Gymnasium environments their time limit, or
    200). The videos must be one frame longer at least."""

    evaluation_steps: int | None = None
    """Agent steps of an evaluation episode, instead of the task's own."""

    device: str = "auto"
    """Where networks compute: auto (a CUDA GPU where PyTorch sees one, else the CPU), cpu, cuda, cuda:NUMBER, or mps on
    a Mac. None but the CPU has been tried."""

    threads: int = 1
    """Threads PyTorch computes with; docs/performance.md says when more than one pays."""

    checkpoint_minutes: float = 20.0
    """Minutes between two checkpoints; one is also written at the end and when the run is interrupted."""

    tracker: TrackerName = "tensorboard"
    """Where metrics go beside metrics.jsonl. tensorboard: event files in the run, where TensorBoard is installed.
    wandb: Weights & Biases (extra `wandb`), with the showcase's videos and the report; WANDB_MODE=offline keeps all of
    it in the run. none: nowhere else."""

    def __post_init__(self) -> None:
        check_device_name(self.device)
        require_choices("training", self)
        lengths = ("action_repeat", "episode_steps", "evaluation_steps")
        require_at_least(1, threads=self.threads, **fields_of("training", self, *lengths))
        require_at_most(MOST_THREADS, threads=self.threads)
        require_at_most(LONGEST_EPISODE, **fields_of("training", self, *lengths))
        require_positive(checkpoint_minutes=self.checkpoint_minutes)
        require_reasonable("", self)
