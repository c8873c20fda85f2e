"""One run of a sweep: what it is, where it is written, and the words that `bootifol` is given for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bootifol.demos.manifest import MANIFEST_NAME, read_manifest
from bootifol.plugins import imports_code
from bootifol.presets import preset
from bootifol.rewards.registry import METHODS
from bootifol.tasks import TASKS, short_name
from bootifol.training.budget import parse_duration
from bootifol.training.config import TrainingConfig
from bootifol.training.overrides import overridden

Value = str | int | float | bool | None
Overrides = tuple[tuple[str, Value], ...]
"""Fields by their place in the configuration, such as `("alignment.gradient_steps", 0)`, and their values."""

RANDOM = "random"
"""The lower end of the scale. It learns nothing, so `train` has no such method: `random_actions.py` plays it."""


@dataclass(frozen=True)
class PlannedRun:
    """One run of a sweep."""

    task: str
    method: str = "bootifol"
    preset: str = "cpu"
    variant: str = ""
    """What sets it apart from other runs of its method; empty where nothing does."""
    overrides: Overrides = ()
    seed: int = 1
    demos: Path = Path("demos")
    """Directory of its demo sets."""
    videos: int | None = None
    """Expert videos to record where there are none; None where they must be there."""
    time_budget: str | None = None
    cpus: int = 1
    """Cores, and threads."""
    gpus: float = 0.0
    retries: int = 3
    """How often it goes on after the machine that it was on has died."""

    @property
    def system(self) -> str:
        """METHOD or METHOD-VARIANT; MODULE.NAME of a method of one's own."""
        method = self.method.replace(":", ".")
        return f"{method}-{self.variant}" if self.variant else method

    @property
    def name(self) -> str:
        """TASK/METHOD[-VARIANT]/seedN, also its directory."""
        return f"{short_name(self.task)}/{self.system}/seed{self.seed}"

    @property
    def config(self) -> TrainingConfig:
        """The whole configuration that its words describe.

        Raises:
            BootifolError: a field is unknown, or a value is none that it can have.
        """
        where = f"{self.system} with the preset {self.preset}"
        changed = overridden(preset(self.preset, self.method), dict(self.overrides), where)
        return replace(changed, threads=self.cpus)

    @property
    def seconds(self) -> float | None:
        """Of its time budget."""
        return None if self.time_budget is None else parse_duration(self.time_budget)

    def words(self, out: Path) -> list[str]:
        """The words after `bootifol` that begin it; for random actions, `random` stands in place of `train`."""
        words = ["train", "--method", self.method] if self.method != RANDOM else [RANDOM]
        words += ["--task", self.task, "--preset", self.preset, "--seed", str(self.seed)]
        words += ["--demos", str(self.demos), "--out", str(out), "--threads", str(self.cpus)]
        words += [] if self.time_budget is None else ["--time-budget", self.time_budget]
        for field, value in self.overrides:
            words += [f"--{field.replace('_', '-')}", str(value)]
        return words

    def words_to_resume(self, out: Path) -> list[str]:
        """The words that go on with it; random actions, which nothing depends on, begin anew."""
        if self.method == RANDOM:
            return self.words(out)
        trust = ["--trust"] if names_code(self.task) or names_code(self.method) else []
        return ["train", "--resume", str(out), *trust]


def names_code(name: str) -> bool:
    """Whether a task or a method is somebody's code; the library's own names are seen at once to be none."""
    return name not in TASKS and name not in METHODS and name != RANDOM and imports_code(name)


def missing_videos(demos: Path) -> list[str]:
    """The behaviors that a run needs videos of, and whose recording is not complete in the directory."""

    def complete(behavior: str) -> bool:
        path = demos / behavior
        return (path / MANIFEST_NAME).is_file() and read_manifest(path).complete

    # half_good videos only measure the reward: recorded with the expert's, and not missed beside imported ones.
    if not complete("expert"):
        return ["expert", "random", "half_good"]
    return [] if complete("random") else ["random"]


def record_words(run: PlannedRun, behaviors: Sequence[str], videos: int) -> list[str]:
    """The words after `bootifol` that record what a run learns from.

    Args:
        run: whose configuration decides how the videos must look and how long they are.
        behaviors: who performs.
        videos: of each behavior.
    """
    config = run.config
    pictures = config.pictures
    words = ["demos", "record", "--task", run.task, "--out", str(run.demos), "--episodes", str(videos)]
    for name, length in (("episode-steps", config.episode_steps), ("action-repeat", config.action_repeat)):
        words += [] if length is None else [f"--{name}", str(length)]
    words += ["--agent-size", str(pictures.agent_size), "--video-size", str(pictures.video_size)]
    words += [] if pictures.profile == "fast" else ["--profile", pictures.profile]
    return [*words, "--workers", str(run.cpus), "--behaviors", *behaviors]
