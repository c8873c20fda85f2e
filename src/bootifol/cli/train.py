"""`bootifol train`: videos in, policy out."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from bootifol.cli.arguments import Trust
from bootifol.errors import STOPPED, BootifolError
from bootifol.presets import PresetName, preset
from bootifol.tasks import short_name
from bootifol.training.config import TrainingConfig


def preset_of(words: Sequence[str]) -> TrainingConfig:
    """The configuration whose values are the defaults of `train`'s flags, from `--preset` and `--method` among them."""
    return preset(_value_of("--preset", words, "cpu"), _value_of("--method", words, "bootifol"))


def _value_of(flag: str, words: Sequence[str], default: str) -> str:
    for index, word in enumerate(words):
        name, _, value = word.partition("=")
        if name == flag:
            return value or (words[index + 1] if index + 1 < len(words) else "")
    return default


def flags_of(words: Sequence[str]) -> list[str]:
    """The flags among the words of a command, each once, without their values."""
    return list(dict.fromkeys(word.partition("=")[0] for word in words if word.startswith("--")))


def train(
    config: Annotated[TrainingConfig, tyro.conf.arg(name="")],
    task: Annotated[
        str | None, tyro.conf.arg(metavar="STR", help_behavior_hint="(default: of the videos)")
    ] = None,
    method: str = "bootifol",
    preset: PresetName = "cpu",
    demos: Annotated[Path | None, tyro.conf.arg(metavar="PATH", help_behavior_hint="(required)")] = None,
    out: Annotated[Path | None, tyro.conf.arg(metavar="PATH", help_behavior_hint="(required)")] = None,
    seed: int = 1,
    time_budget: str | None = None,
    resume: Annotated[
        Path | None, tyro.conf.arg(metavar="RUN", help_behavior_hint="(no other flags but --trust)")
    ] = None,
    trust: Trust = 0,
    words: Annotated[tuple[str, ...], tyro.conf.Fixed, tyro.conf.Suppress] = (),
) -> int:
    """Learn a reward from videos and train a policy on it, or go on with an interrupted run.

    Ctrl-C writes a checkpoint and exits with 130; `--resume` goes on from there.

    Args:
        config: Every setting of the preset, which the flags below change one by one.
        task: The environment to act in: a name that `bootifol tasks` lists, gymnasium:ID, or MODULE:FUNCTION, which
            returns a Gymnasium environment. Recorded videos know theirs.
        method: bootifol, virl, context_translation and gaifo learn a reward from the videos; environment uses the true
            reward, as an upper bound. MODULE:NAME is a method of your own (docs/add_a_method.md).
        preset: paper: its hyperparameters. cpu: one to two hours on one core. long: the paper's 1.55M agent steps in
            two and a half. demo: what `make demo` runs, in minutes. frames: cpu, with a reward from single frames
            (docs/frames.md). drawn: the same for the tasks drawn with numpy, in minutes; drawn_pixels: with the paper's
            objective. smoke: every stage, in under two minutes. backbone: paper, with a pretrained EfficientNet-B0
            that reads videos of 224x224 pixels.
        demos: Directory of the videos, from `bootifol demos record` or `bootifol demos import`.
        out: Directory to write the run to, such as runs/first.
        seed: Of everything random.
        time_budget: Wall-clock time for learning, such as 90s, 45m or 1h30m; schedules are stretched to fit it.
            The final evaluation and the report come after it.
        resume: Directory of an interrupted run to go on with; its own configuration is used.
        trust: Import the code that RUN, or the videos without --task, name (MODULE:NAME).
        words: What was typed.
    """
    # Imported here: help should not wait for PyTorch.
    from bootifol.training.api import continue_run, train_policy
    from bootifol.training.budget import parse_duration

    if resume is not None:
        if ignored := [flag for flag in flags_of(words) if flag not in ("--resume", "--trust")]:
            raise BootifolError(
                f"--resume goes on with the configuration that {resume} was begun with and would ignore "
                f"{', '.join(ignored)}: leave out all but --resume, or begin a new run with --demos and --out"
            )
        finished = continue_run(resume, trust=True) if trust else continue_run(resume)
        return 0 if finished else STOPPED
    if demos is None or out is None:
        name = task or "TASK"
        videos = (
            f"record videos with `bootifol demos record --task {name} --out demos/{name}`"
            if ":" not in name
            else f"import videos with `bootifol demos import YOUR_VIDEOS --out demos/{short_name(name)}`"
        )
        raise BootifolError(
            "train needs --demos (the videos) and --out (where to write the run), or --resume RUN to go on; "
            + videos
        )
    seconds = None if time_budget is None else parse_duration(time_budget)
    run = train_policy(
        task or _task_shown(demos, bool(trust)),
        demos,
        out,
        method=method,
        preset=preset,
        seed=seed,
        time_budget=seconds,
        config=config,
        command=["bootifol", *words],
    )
    return 0 if run.finished else STOPPED


def _task_shown(demos: Path, trust: bool) -> str:
    """The task that recorded videos show; random ones beside imported ones tell it, too.

    Raises:
        BootifolError: nothing there was recorded, more than one task was, or it is code that nobody trusts.
    """
    from bootifol.demos.demo_set import find_demo_sets
    from bootifol.demos.manifest import MANIFEST_NAME, read_manifest
    from bootifol.own_modules import require_trust

    tasks: set[str] = set()
    for directory in find_demo_sets(demos).values():
        if (task := read_manifest(directory).task) is not None:
            require_trust(directory / MANIFEST_NAME, "task", task, trust)
            tasks.add(task)
    if len(tasks) != 1:
        why = "show more than one task" if tasks else "were imported, so nothing says what they show"
        raise BootifolError(
            f"the videos in {demos} {why}: add --task NAME, with a name that `bootifol tasks` lists, gymnasium:ID, or "
            "MODULE:FUNCTION"
        )
    (task,) = tasks
    print(f"--task {task}: what the videos in {demos} show", file=sys.stderr)
    return task
