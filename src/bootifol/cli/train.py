"""`bootifol train`: videos in, policy out."""

from __future__ import annotations

import functools
import sys
import types
import typing
from collections.abc import Callable, Sequence
from dataclasses import make_dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from bootifol.cli.arguments import Flag, Trust
from bootifol.cli.help_texts import field_texts
from bootifol.errors import STOPPED, BootifolError
from bootifol.plugins import imports_code, require_trust
from bootifol.presets import PresetName, preset
from bootifol.tasks import short_name
from bootifol.training.config import TrainingConfig
from bootifol.training.config_files import ConfigFile, config_text, read_config_file

ON_THE_FIRST_SCREEN = ("threads",)
"""Fields of a run that `--help` shows; `--help-all` shows every one."""


def preset_of(words: Sequence[str]) -> TrainingConfig:
    """The configuration that `--preset` and `--method` among the words name."""
    return preset(_value_of("--preset", words, "cpu"), _value_of("--method", words, "bootifol"))


def command_of(words: Sequence[str]) -> Callable[..., int]:
    """`train` with the defaults that its words give its flags: those of `--config`'s file, and of the preset.

    Raises:
        BootifolError: the file cannot be read, or there is no such preset.
    """
    path = _value_of("--config", words, "")
    file = read_config_file(Path(path)) if path else ConfigFile()
    method = _value_of("--method", words, file.method or "bootifol")
    name = _value_of("--preset", words, file.preset or "cpu")
    try:
        training = file.configured(preset(name, method), path)
    except BootifolError as error:
        raise (
            BootifolError(f"{path}: {error}") if name == file.preset and path not in str(error) else error
        ) from error
    if name != (said_by_file := file.preset or name) and training == file.configured(
        preset(said_by_file, method), path
    ):
        raise BootifolError(
            f"{path} says every field, so --preset {name} would change none: leave one of the two out"
        )
    said: dict[str, Any] = {
        "task": file.task,
        "time_budget": file.time_budget,
        "method": method,
        "preset": name,
    }
    said |= {place: Path(there) for place in ("demos", "out") if (there := getattr(file, place)) is not None}
    if file.seed is not None:
        said["seed"] = file.seed
    if {"-h", "--help"} & set(words):
        shown: Any = {field: getattr(training, field) for field in ON_THE_FIRST_SCREEN}
        command = _with_fields(ON_THE_FIRST_SCREEN)
        return functools.partial(command, training=_few(ON_THE_FIRST_SCREEN)(**shown), **said)
    return functools.partial(train, training=training, words=tuple(words), **said)


def _with_fields(names: tuple[str, ...]) -> Callable[..., int]:
    """`train`, for its help alone, with a few fields of a run in place of all."""
    command = types.FunctionType(train.__code__, train.__globals__, train.__name__, train.__defaults__)
    command.__doc__ = train.__doc__
    command.__annotations__ = train.__annotations__ | {
        "training": Annotated[_few(names), tyro.conf.arg(name="")]
    }
    return command


@functools.cache
def _few(names: tuple[str, ...]) -> type:
    """A class of some fields of `TrainingConfig`, with their texts."""
    kinds, texts = typing.get_type_hints(TrainingConfig), field_texts(TrainingConfig)
    few = make_dataclass("Few", [(name, kinds[name]) for name in names], frozen=True)
    few.__doc__ = "\n".join(["", "Attributes:", *(f"    {name}: {texts[name]}" for name in names)])
    return few


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
    training: Annotated[TrainingConfig, tyro.conf.arg(name="")],
    task: Annotated[
        str | None, tyro.conf.arg(metavar="STR", help_behavior_hint="(default: of the videos)")
    ] = None,
    demos: Annotated[Path | None, tyro.conf.arg(metavar="PATH", help_behavior_hint="(required)")] = None,
    out: Annotated[Path | None, tyro.conf.arg(metavar="PATH", help_behavior_hint="(required)")] = None,
    preset: PresetName = "cpu",
    method: str = "bootifol",
    seed: int = 1,
    time_budget: str | None = None,
    config: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: none)")
    ] = None,
    resume: Annotated[
        Path | None, tyro.conf.arg(metavar="RUN", help_behavior_hint="(no other flags but --trust)")
    ] = None,
    print_config: Flag = 0,
    trust: Trust = 0,
    words: Annotated[tuple[str, ...], tyro.conf.Fixed, tyro.conf.Suppress] = (),
) -> int:
    """Learn a reward from videos and train a policy on it, or go on with an interrupted run.

    Ctrl-C writes a checkpoint and exits with 130; `--resume` goes on from there. `bootifol train --help-all` lists
    every field of a run, such as --agent.batch-size.

    Args:
        training: Every field of a run, of which flags change one by one.
        task: The environment to act in: a name that `bootifol tasks` lists, gymnasium:ID, or MODULE:FUNCTION, which
            returns a Gymnasium environment. Recorded videos know theirs.
        demos: Directory of the videos, from `bootifol demos record` or `bootifol demos import`.
        out: Directory to write the run to, such as runs/first.
        preset: cpu: one to two hours on one core. long: the paper's 1.55M agent steps in two and a half. frames: cpu,
            with a reward from single frames (docs/frames.md). drawn: the same for the tasks drawn with numpy, in
            minutes; drawn_pixels: with the paper's objective. demo: what `make demo` runs, in minutes. smoke: every
            stage, in under two minutes. paper: its hyperparameters. backbone: paper, with a pretrained EfficientNet-B0
            that reads videos of 224x224 pixels.
        method: bootifol, virl, context_translation and gaifo learn a reward from the videos; environment uses the true
            reward, as an upper bound. MODULE:NAME is a method of your own, and installed packages may bring others
            (docs/add_a_method.md).
        seed: Of everything random.
        time_budget: Wall-clock time for learning, such as 90s, 45m or 1h30m; schedules are stretched to fit it.
            The final evaluation and the report come after it.
        config: A YAML or JSON file with any of these flags and fields, or a run's config.json; what is typed goes
            before it (docs/configuration.md).
        resume: Directory of an interrupted run to go on with; its own configuration is used.
        print_config: Print the configuration that this command would train with, as a file for --config, and train
            nothing.
        trust: Import the code that FILE, RUN, or the videos without --task, name (MODULE:NAME).
        words: What was typed.
    """
    # Imported here: help should not wait for PyTorch.
    from bootifol import api
    from bootifol.training.budget import parse_duration

    if resume is not None:
        if ignored := [flag for flag in flags_of(words) if flag not in ("--resume", "--trust")]:
            raise BootifolError(
                f"--resume goes on with the configuration that {resume} was begun with and would ignore "
                f"{', '.join(ignored)}: leave out all but --resume, or begin a new run with --demos and --out"
            )
        finished = api.resume(resume, trust=True) if trust else api.resume(resume)
        return 0 if finished else STOPPED
    if config is not None:
        _require_trust_of_names(config, {"task": task, "method": method}, words, bool(trust))
    if print_config:
        shown = task if task is not None or demos is None else _task_shown(demos, bool(trust))
        text = config_text(
            training,
            task=shown,
            method=method,
            preset=preset,
            seed=seed,
            time_budget=time_budget,
            demos=None if demos is None else str(demos),
            out=None if out is None else str(out),
        )
        print(text, end="")
        return 0
    if demos is None or out is None:
        name = task or "TASK"
        videos = (
            f"record videos with `bootifol demos record --task {name} --out demos/{name}`"
            if ":" not in name and not imports_code(name)
            else f"import videos with `bootifol demos import YOUR_VIDEOS --out demos/{short_name(name)}`"
        )
        raise BootifolError(
            "train needs --demos (the videos) and --out (where to write the run), or --resume RUN to go on; "
            + videos
        )
    seconds = None if time_budget is None else parse_duration(time_budget)
    run = api.train(
        task or _task_shown(demos, bool(trust)),
        demos,
        out,
        method=method,
        preset=preset,
        seed=seed,
        time_budget=seconds,
        config=training,
        command=["bootifol", *words],
    )
    return 0 if run.finished else STOPPED


def _require_trust_of_names(
    file: Path, names: dict[str, str | None], words: Sequence[str], trust: bool
) -> None:
    """Refuses task or method of a file, if it is code, nobody typed it, and nobody trusts it.

    Raises:
        BootifolError: see there.
    """
    typed = flags_of(words)
    for what, name in names.items():
        if name is not None and f"--{what}" not in typed:
            require_trust(file, what, name, trust)


def _task_shown(demos: Path, trust: bool) -> str:
    """The task that recorded videos show; random ones beside imported ones tell it, too.

    Raises:
        BootifolError: nothing there was recorded, more than one task was, or it is code that nobody trusts.
    """
    from bootifol.demos.manifest import MANIFEST_NAME, find_demo_sets, read_manifest

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
