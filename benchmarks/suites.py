"""What the paper compares, as lists of runs: systems, tasks and seeds under equal terms.

A run is one `bootifol train` command. All runs of a task learn from the same videos, with the same agent, budget and
evaluation; what a system changes of its preset is written here and nowhere else. One system reads the videos at another
size, and with the paper's sizes it has a preset of its own: `with_backbone`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from bootifol.errors import BootifolError
from bootifol.own_modules import is_own_name
from bootifol.presets import BACKBONE, PAPER, preset
from bootifol.reports.names import CLONING_ALONE
from bootifol.reports.paper_results import META_WORLD, RETURNS
from bootifol.tasks import short_name, task_named
from bootifol.training.config import TrainingConfig

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Section = TypeVar("Section", bound="DataclassInstance")
Value = str | int | float | bool
Overrides = tuple[tuple[str, Value], ...]
"""Fields by their place in the configuration, such as `("alignment.gradient_steps", 0)`, and their values."""

RANDOM = "random"
"""The lower end of the scale: it learns nothing, so `benchmarks/random_policy.py` plays it instead of `train`."""

OPTIMAL_TRANSPORT = "optimal_transport:OptimalTransport"
"""The method that docs/add_a_method.md adds, at sizes of its own; the queue writes its module."""

UNHEARD: Overrides = (("agent.cloning_weight", CLONING_ALONE),)
"""No reward is heard, so the agent is what the videos' inferred actions make of it."""


@dataclass(frozen=True)
class System:
    """What is compared: a method, or a variant of it."""

    method: str
    variant: str = ""
    overrides: Overrides = ()
    preset: str = ""
    """Its own; empty for the suite's."""
    video_size: int | None = None
    """Height and width in pixels where it reads videos of a size of its own, which have a directory of their own."""
    tasks: tuple[str, ...] = ()
    """The only ones that it is compared on; empty for all."""

    @property
    def name(self) -> str:
        """METHOD or METHOD-VARIANT; MODULE.NAME of a method of one's own."""
        method = self.method.replace(":", ".")
        return f"{method}-{self.variant}" if self.variant else method

    def is_compared_on(self, task: str) -> bool:
        """Whether the task is one of its own."""
        return not self.tasks or task in self.tasks


@dataclass(frozen=True)
class PlannedRun:
    """One run of a suite."""

    task: str
    preset: str
    system: System
    seed: int

    @property
    def name(self) -> str:
        """TASK/METHOD[-VARIANT]/seedN, also its directory."""
        return f"{short_name(self.task)}/{self.system.name}/seed{self.seed}"

    @property
    def demos_name(self) -> str:
        """TASK[-SIZE], the directory of its videos."""
        size = self.system.video_size
        return short_name(self.task) if size is None else f"{short_name(self.task)}-{size}"

    @property
    def config(self) -> TrainingConfig:
        """The whole configuration that `words` describes."""
        return with_overrides(preset(self.preset), (*self.system.overrides, ("threads", 1)))

    def words(self, demos: Path, out: Path, time_budget: str | None) -> list[str]:
        """The words after `bootifol train`."""
        words = ["--task", self.task, "--method", self.system.method, "--preset", self.preset]
        words += ["--seed", str(self.seed), "--demos", str(demos), "--out", str(out), "--threads", "1"]
        words += [] if time_budget is None else ["--time-budget", time_budget]
        for field, value in self.system.overrides:
            words += [f"--{field.replace('_', '-')}", str(value)]
        return words


def with_overrides(config: TrainingConfig, overrides: Overrides) -> TrainingConfig:
    """The configuration with some of its fields replaced, those of one section together.

    Raises:
        BootifolError: the values are not allowed.
    """
    nested: dict[str, dict[str, Value]] = {}
    for field, value in overrides:
        section, _, name = field.rpartition(".")
        nested.setdefault(section, {})[name] = value
    for section, values in nested.items():
        config = _replaced(config, section.split(".") if section else [], values)
    return config


def _replaced(config: Section, path: list[str], values: dict[str, Value]) -> Section:
    if not path:
        return dataclasses.replace(config, **values)
    inner = _replaced(getattr(config, path[0]), path[1:], values)
    return dataclasses.replace(config, **{path[0]: inner})


def every_system(config: TrainingConfig, timed: bool) -> list[System]:
    """Every system of the paper's tables: its method, those it compares with, and both ends of the scale.

    Videos, agent, budget and evaluation are the same for all. How many gradient steps its reward takes is a method's
    own: in the paper ViRL takes twice BootIfOL's, and context translation, which learns nothing while the agent acts,
    takes about three times BootIfOL's Alignment Phase in its release. They do so in small presets, too. Where the
    policy starts as a clone of the videos, `cloning_alone` shows what any reward adds to that, and `environment`, which
    is given no videos, explores as DrQ-v2 does.
    """
    cosine = (("reward.bootifol.reward", "cosine"), ("reward.bootifol.reward_scale", "none"))
    translation = (("alignment.gradient_steps", 3 * config.alignment.gradient_steps),)
    references = "reward.context_translation.references"
    clones = config.demonstrations.share > 0
    steps = config.interactive.agent_steps
    explores = (("agent.exploration_start", 1.0), ("agent.exploration_steps", steps * 2 // 3))
    return [
        System("bootifol"),
        System("bootifol", "cosine", cosine),
        *(dataclasses.replace(system, tasks=tuple(META_WORLD.tasks)) for system in with_backbone(config)),
        System("virl", overrides=(("interactive.reward_update_every", virl_updates_every(config)),)),
        System("gaifo"),
        System("context_translation", "n1", ((references, 1), *translation)),
        System("context_translation", "n10", ((references, 10), *translation)),
        *([System("bootifol", "cloning_alone", UNHEARD)] if clones else []),
        System("environment", overrides=explores if clones else ()),
        System(RANDOM),
    ]


def learning_test(config: TrainingConfig, timed: bool) -> list[System]:
    """Every system, and a method that is no part of the library."""
    return [*every_system(config, timed), System(OPTIMAL_TRANSPORT)]


def virl_updates_every(config: TrainingConfig) -> int:
    """Agent steps between two gradient steps of ViRL, so that it takes twice as many as BootIfOL, as in the paper.

    There it has 50. BootIfOL's are counted with the equivalent of the paper's N_train, or the preset's where it is
    later: one that lets BootIfOL's reward rest sooner should not make ViRL, which learns to the end, learn less.
    """
    interactive, warm_up = config.interactive, config.agent.warm_up_steps
    as_in_paper = equivalent_steps(config, PAPER.interactive.reward_updates_until, timed=False)
    until = max(as_in_paper, interactive.reward_updates_until)
    acting = max(until - warm_up, 0) / interactive.reward_update_every
    wanted = 2 * (config.alignment.gradient_steps + acting)
    return max(round((interactive.agent_steps - warm_up) / max(wanted, 1.0)), 1)


def with_backbone(config: TrainingConfig) -> list[System]:
    """The paper's Eff-BootIfOL, whose frozen pretrained backbone reads videos of 224x224 pixels.

    With the preset `paper` it is the preset `backbone`. Elsewhere it has EfficientNet-Lite0, whose weights come in a
    package, and all else as the preset has it.

    Returns:
        It alone; nothing where the preset has a backbone, so that `bootifol` is Eff-BootIfOL already.
    """
    if config.reward.bootifol.backbone is not None:
        return []
    size = BACKBONE.pictures.video_size
    if config == PAPER:
        return [System("bootifol", "backbone", preset="backbone", video_size=size)]
    lite = (("reward.bootifol.backbone", "efficientnet_lite0"), ("pictures.video_size", size))
    return [System("bootifol", "backbone", lite, video_size=size)]


def backbone_comparison(config: TrainingConfig, timed: bool) -> list[System]:
    """The paper's method from scratch, and with a pretrained backbone, on any task.

    Both are evaluated in fewer episodes: at 224x224 pixels, 50 of 500 agent steps take a third of an hour to render.
    """
    fewer = (("evaluation.long_episodes", 1), ("evaluation.final_episodes", 20))
    systems = [System("bootifol"), *with_backbone(config)]
    return [dataclasses.replace(system, overrides=(*system.overrides, *fewer)) for system in systems]


def alignment_ablation(config: TrainingConfig, timed: bool) -> list[System]:
    """The paper's `alignment`, `no-alignment` and `no-alignment-1550K-step`, the first two with its N_train."""
    without = ("alignment.gradient_steps", 0)
    as_in_paper = trained(config, PAPER.interactive.reward_updates_until, timed)
    to_the_end = ("interactive.reward_updates_until", config.interactive.agent_steps)
    return [
        as_in_paper,
        System("bootifol", "no_alignment", (without, *as_in_paper.overrides)),
        System("bootifol", "no_alignment_to_the_end", (without, to_the_end)),
    ]


def encoder_training_ablation(config: TrainingConfig, timed: bool) -> list[System]:
    """N_train = 0, 100K, 375K and 1550K of the paper's 1550K agent steps, or the same shares of a shorter run."""
    return [trained(config, agent_steps, timed) for agent_steps in (0, 100_000, 375_000, 1_550_000)]


def trained(config: TrainingConfig, agent_steps: int, timed: bool) -> System:
    """BootIfOL with the equivalent of so many agent steps of the paper's as N_train."""
    percent = round(100 * agent_steps / PAPER.interactive.agent_steps)
    until = equivalent_steps(config, agent_steps, timed)
    return System("bootifol", f"trained_{percent}_percent", (("interactive.reward_updates_until", until),))


def failures(config: TrainingConfig, timed: bool) -> list[System]:
    """A reward that learns to the end of the run from all of the agent's videos, or from its failures alone."""
    to_the_end = ("interactive.reward_updates_until", config.interactive.agent_steps)
    return [
        System("bootifol", "trained_0_percent", (("interactive.reward_updates_until", 0),)),
        System("bootifol", "trained_100_percent", (to_the_end,)),
        System("bootifol", "failures_50_percent", (to_the_end, ("interactive.failures_share", 0.5))),
        System("bootifol", "failures_25_percent", (to_the_end, ("interactive.failures_share", 0.25))),
    ]


def equivalent_steps(config: TrainingConfig, paper_steps: int, timed: bool) -> int:
    """N_train of a run that trains its encoders for the same share of its learning as the paper's did.

    Learning begins after the warm-up, which is 0.1 % of the paper's run and a fifth of `cpu`: so shares are of the
    agent steps that follow it. With a time budget, schedules follow the time, of which a warm-up takes next to nothing.

    Args:
        config: of the run.
        paper_steps: N_train in the paper's run.
        timed: whether the run has a time budget.
    """
    if paper_steps == 0:
        return 0
    total, of_paper = config.interactive.agent_steps, PAPER.interactive.agent_steps
    if timed:
        return round(total * paper_steps / of_paper)
    before, before_of_paper = config.agent.warm_up_steps, PAPER.agent.warm_up_steps
    return before + round((total - before) * (paper_steps - before_of_paper) / (of_paper - before_of_paper))


def policy_input_ablation(config: TrainingConfig, timed: bool) -> list[System]:
    """The image-based and the encoding-based agent."""
    return [System("bootifol"), System("bootifol", "encodings", (("agent.observations", "encodings"),))]


def remedies(config: TrainingConfig, timed: bool) -> list[System]:
    """The preset, and the preset without one of its departures from the paper, or with one more."""
    paper = PAPER.agent
    nothing_cloned = (
        *(("demonstrations.share", 0.0), ("agent.cloning_weight", 0.0)),
        *(("agent.warm_up_steps", paper.warm_up_steps), ("agent.warm_up_hold", paper.warm_up_hold)),
        ("agent.exploration_start", paper.exploration_start),
    )
    clones = config.demonstrations.share > 0
    return [
        System("bootifol"),
        System("bootifol", "no_saturation_weight", (("agent.saturation_weight", 0.0),)),
        System("bootifol", "unscaled_reward", (("reward.bootifol.reward_scale", "none"),)),
        System("bootifol", "rewards_stored_once", (("interactive.relabel_episodes", 0),)),
        System("bootifol", "half_spoiled", (("reward.bootifol.spoiled_share", 0.5),)),
        *([System("bootifol", "nothing_cloned", nothing_cloned)] if clones else []),
    ]


def precisions(config: TrainingConfig, timed: bool) -> list[System]:
    """Networks that compute in bf16, as small presets do, and in fp32."""
    both = ("agent.precision", "reward.bootifol.precision")
    return [
        System("bootifol", precision, tuple((field, precision) for field in both))
        for precision in ("bf16", "fp32")
    ]


SMALL: Overrides = (
    ("pictures.agent_size", 32),
    ("pictures.video_size", 32),
    ("reward.bootifol.width_divisor", 32),
    ("reward.bootifol.videos_per_class", 2),
    ("agent.encoder", "strided"),
    ("agent.update_every", 10),
    ("agent.batch_size", 8),
    ("agent.warm_up_steps", 60),
    ("alignment.gradient_steps", 4),
    ("interactive.agent_steps", 240),
    ("tracker", "none"),
)


def smallest(config: TrainingConfig, timed: bool) -> list[System]:
    """A method, and both ends of the scale, in seconds."""
    return [System(method, overrides=SMALL) for method in ("bootifol", "environment", RANDOM)]


@dataclass(frozen=True)
class Suite:
    """A named list of runs."""

    description: str
    preset: str
    tasks: tuple[str, ...]
    seeds: tuple[int, ...]
    systems: Callable[[TrainingConfig, bool], list[System]]
    """From the preset, and whether runs have a time budget."""

    def runs(
        self,
        preset_name: str | None = None,
        tasks: Sequence[str] | None = None,
        seeds: Sequence[int] | None = None,
        timed: bool = False,
        own: Sequence[str] = (),
    ) -> list[PlannedRun]:
        """Its runs, the first seed of everything first.

        Args:
            preset_name: instead of its own.
            tasks: instead of its own.
            seeds: instead of its own.
            timed: whether each run has a time budget.
            own: more methods to compare, as MODULE:NAME.

        Raises:
            BootifolError: there is no such preset or task, the preset does not allow what a system changes, or a
                method of one's own has no such name.
        """
        for method in own:
            if not is_own_name(method):
                raise BootifolError(f"a method of your own is named MODULE:NAME, not '{method}'")
        name = preset_name or self.preset
        systems = list(dict.fromkeys([*self.systems(preset(name), timed), *map(System, own)]))
        runs = [
            PlannedRun(task, system.preset or name, system, seed)
            for seed in seeds or self.seeds
            for task in tasks or self.tasks
            for system in systems
            if system.is_compared_on(task)
        ]
        for task in tasks or self.tasks:
            task_named(task)
        for system in systems:
            with_overrides(preset(system.preset or name), system.overrides)
        return runs


SEVEN_TASKS = tuple(RETURNS)
FIVE_SEEDS = (1, 2, 3, 4, 5)
THREE_SEEDS = (1, 2, 3)
_ablation = partial(Suite, preset="cpu", tasks=("reacher_hard",), seeds=THREE_SEEDS)

SUITES = {
    "reacher": Suite("every system on Reacher Hard", "cpu", ("reacher_hard",), (1,), every_system),
    "paper": Suite(
        "the paper's tables: seven tasks, every system, five seeds, the paper's sizes",
        "paper",
        SEVEN_TASKS,
        FIVE_SEEDS,
        every_system,
    ),
    "cpu": Suite(
        "the same with the preset cpu, about an hour a run",
        "cpu",
        SEVEN_TASKS,
        FIVE_SEEDS,
        every_system,
    ),
    "backbone": Suite(
        "bootifol from scratch and with a pretrained backbone on Drawer Close",
        "cpu",
        ("drawer_close",),
        (1,),
        backbone_comparison,
    ),
    "alignment": _ablation(
        "ablation: with, without, and without the Alignment Phase but trained to the end",
        systems=alignment_ablation,
    ),
    "encoder_training": _ablation(
        "ablation: how long the encoders learn while the agent acts", systems=encoder_training_ablation
    ),
    "policy_input": _ablation(
        "ablation: a policy that sees pictures, or the reward model's encodings of them",
        systems=policy_input_ablation,
    ),
    "drawn": Suite(
        "learning test: every system, and a tutorial's, on a task drawn with numpy, minutes a run",
        "drawn_pixels",
        ("drawn_home",),
        THREE_SEEDS,
        learning_test,
    ),
    "failures": Suite(
        "beyond the paper: bootstrapping on all of the agent's videos, or on those of the lowest learned reward",
        "drawn_pixels",
        ("drawn_home",),
        THREE_SEEDS,
        failures,
    ),
    "remedies": Suite(
        "the preset without one of its departures from the paper, or with one more",
        "drawn_pixels",
        ("drawn_home",),
        THREE_SEEDS,
        remedies,
    ),
    "precision": Suite(
        "what bf16 does to returns: agent and reward in bf16, and in fp32",
        "drawn_pixels",
        ("drawn_home",),
        FIVE_SEEDS,
        precisions,
    ),
    "smoke": Suite("three runs of seconds, which learn nothing", "smoke", ("drawn_home",), (1,), smallest),
}

VIDEOS = {
    "paper": 5032,
    "backbone": 1532,
    "cpu": 1000,
    "long": 1000,
    "demo": 700,
    "smoke": 12,
    "drawn_pixels": 150,
    "frames": 600,
    "drawn": 400,
}
"""Expert videos to record for each preset. The paper learns from 5000, with a backbone from 1500; up to 32 are held
out to see how they rank."""


def named(name: str) -> Suite:
    """Looks a suite up.

    Raises:
        BootifolError: there is none of that name.
    """
    if name not in SUITES:
        raise BootifolError(f"there is no suite '{name}'; the suites are {', '.join(SUITES)}")
    return SUITES[name]


def demos_of(runs: Iterable[PlannedRun]) -> dict[str, PlannedRun]:
    """The directories of videos of some runs, each with its first run, which says how its videos must look."""
    first: dict[str, PlannedRun] = {}
    for run in runs:
        first.setdefault(run.demos_name, run)
    return first
