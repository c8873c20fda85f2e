"""The file of a sweep: which runs there are, in YAML.

    tasks: [drawn_home, drawn_reach]
    methods: [bootifol, virl]
    presets: drawn_pixels
    variants:
      default: {}
      longer: {interactive.agent_steps: 9000}
    seeds: [1, 2, 3]
    demos: demos/{task}

Every task is run with every method, preset, variant and seed. Where methods differ in more than their name, `grids`
holds several such grids, each with the keys that it has in place of the file's own. `Grid` says what the keys are.
"""

from __future__ import annotations

import dataclasses
import difflib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from bootifol.errors import LARGEST_COUNT, LARGEST_SEED, MOST_THREADS, BootifolError, shortened
from bootifol.plugins import require_trust, told
from bootifol.presets import preset
from bootifol.rewards.registry import check_method
from bootifol.sweep.planned import RANDOM, Overrides, PlannedRun, names_code
from bootifol.tasks import short_name, task_named
from bootifol.training.budget import parse_duration
from bootifol.training.config_files import YamlLoader
from bootifol.training.run_config import require_time_to_act

DEFAULT = "default"
"""The variant whose runs have no suffix."""

_NAME = re.compile(r"[\w.-]+")


@dataclass(frozen=True)
class Grid:
    """The keys of a sweep's file. A list of one may be written without its brackets."""

    tasks: tuple[str, ...] = ()
    """Names as `train --task` takes them; one at least."""
    methods: tuple[str, ...] = ("bootifol",)
    """Names as `train --method` takes them, and `random`, which plays the final evaluation with random actions."""
    presets: tuple[str, ...] = ("cpu",)
    """Where there are several, their names are part of the variants'."""
    variants: Mapping[str, Overrides] = field(default_factory=lambda: {DEFAULT: ()})
    """By name, what they change of the preset: dotted fields, as `train --help-all` lists them, and their values. The
    runs of the one that is called `default` are named by their method alone."""
    seeds: tuple[int, ...] = (1,)
    demos: str = "demos/{task}"
    """Directory of the demo sets; {task} is the task's name."""
    videos: int | None = None
    """Expert videos to record where there are none; without it they must be there."""
    time_budget: str | None = None
    """Of each run, such as 60m; without it the agent steps of the configuration."""
    cpus: int = 1
    """Cores of a run, and its threads."""
    gpus: float = 0.0
    """GPUs of a run; with 0.5 two runs share one."""
    retries: int = 3
    """How often a run goes on after its machine has died."""


KEYS = tuple(key.name for key in dataclasses.fields(Grid))
GRIDS = "grids"


def read_sweep(path: Path, trust: bool = False) -> list[PlannedRun]:
    """The runs of a file, the first seed of everything first.

    Args:
        path: of the file.
        trust: whether code that it names (a task or a method MODULE:NAME) may be imported.

    Raises:
        BootifolError: the file cannot be read, or says something that cannot be run.
    """
    of_file = _mapping(_parsed(path), f"{path}")
    _require_known(of_file, (*KEYS, GRIDS), f"{path}")
    grids = of_file.pop(GRIDS, None)
    if grids is None:
        where = {f"{path}": of_file}
    elif isinstance(grids, list) and grids:
        where = {
            f"{path}: grid {number}": _mapping(grid, f"{path}: grid {number}")
            for number, grid in enumerate(grids, start=1)
        }
    else:
        raise BootifolError(f"{path}: {GRIDS} is {shortened(grids)}; write a list of one grid at least")
    runs: list[tuple[int, PlannedRun]] = []
    for place, keys in where.items():
        _require_known(keys, KEYS, place)
        try:
            grid = _grid(of_file | keys)
            for name in filter(names_code, (*grid.tasks, *grid.methods)):
                require_trust(path, "task" if name in grid.tasks else "method", name, trust)
            runs += _runs(grid)
        except BootifolError as error:
            raise BootifolError(str(error) if f"{path}" in str(error) else f"{place}: {error}") from error
    names: set[str] = set()
    for _, run in runs:
        if run.name in names:
            raise BootifolError(
                f"{path} has two runs with the name {run.name}: give one of them a variant with another name"
            )
        names.add(run.name)
    return [run for _, run in sorted(runs, key=lambda numbered: numbered[0])]


def _parsed(path: Path) -> Any:
    try:
        return yaml.load(path.read_text(encoding="utf-8"), YamlLoader)
    except OSError as error:
        raise BootifolError(
            f"the sweep's file cannot be read: {error}; name a YAML file that says which runs there are"
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise BootifolError(f"{path} is no YAML: {told(error)}") from error


def _mapping(value: Any, place: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise BootifolError(
            f"{place} holds {shortened(value)}; write keys and their values ({', '.join(KEYS)})"
        )
    return dict(value)


def _require_known(keys: Mapping[Any, Any], known: tuple[str, ...], place: str) -> None:
    for key in keys:
        if key not in known:
            close = difflib.get_close_matches(str(key), known, 1)
            meant = f" (is {close[0]} meant?)" if close else ""
            raise BootifolError(
                f"{place} has the key {shortened(key)}, which is unknown{meant}: the keys are {', '.join(known)}"
            )


def _grid(keys: Mapping[str, Any]) -> Grid:
    """The keys, each of its type."""
    values: dict[str, Any] = {}
    for key, value in keys.items():
        if key in ("tasks", "methods", "presets"):
            values[key] = _several(key, value, str, "a name")
        elif key == "seeds":
            values[key] = _several(key, value, int, "a whole number", 0, LARGEST_SEED)
        elif key in ("cpus", "videos", "retries"):
            low, high = {"cpus": (1, MOST_THREADS), "videos": (1, LARGEST_COUNT), "retries": (0, 1000)}[key]
            values[key] = _one(key, value, int, "a whole number", low, high)
        elif key == "gpus":
            values[key] = float(_one(key, value, (int, float), "a number", 0, 1024))
        elif key == "variants":
            values[key] = _variants(value)
        else:
            values[key] = _one(key, value, str, "a text")
    grid = Grid(**values)
    if not grid.tasks:
        raise BootifolError("no tasks are named: write for instance `tasks: [drawn_home]`")
    return grid


def _several(key: str, value: Any, kind: Any, what: str, low: float = 0, high: float = 0) -> tuple[Any, ...]:
    items = value if isinstance(value, list) else [value]
    found = tuple(_one(key, item, kind, what, low, high) for item in items)
    if not found or len(set(found)) < len(found):
        raise BootifolError(f"{key} is {shortened(value)}: name one at least, and each once")
    return found


def _one(key: str, value: Any, kind: Any, what: str, low: float = 0, high: float = 0) -> Any:
    fits = isinstance(value, kind) and not isinstance(value, bool)
    if not fits or (high and not low <= value <= high):
        limits = f" from {low:,} to {high:,}" if high else ""
        raise BootifolError(f"{key} holds {shortened(value)}, which is not {what}{limits}")
    return value


def _variants(value: Any) -> dict[str, Overrides]:
    if not isinstance(value, dict) or not value:
        raise BootifolError(f"variants is {shortened(value)}: write NAME: {{FIELD: VALUE}}")
    variants: dict[str, Overrides] = {}
    for name, fields in value.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise BootifolError(
                f"a variant is named {shortened(name)}, which is no name of a directory: use letters, digits, _ . -"
            )
        if not isinstance(fields, dict | None):
            raise BootifolError(f"the variant {name} is {shortened(fields)}: write {{FIELD: VALUE}}")
        for key, inner in (fields or {}).items():
            if not isinstance(key, str) or not isinstance(inner, str | int | float | None):
                raise BootifolError(
                    f"the variant {name} has {shortened(key)}: {shortened(inner)}; write dotted names of fields and "
                    "one value each, such as alignment.gradient_steps: 0"
                )
            if key == "threads":
                raise BootifolError(
                    f"the variant {name} sets threads: those of a run are as many as its cpus"
                )
        variants[name] = tuple((fields or {}).items())
    return variants


def _runs(grid: Grid) -> Iterator[tuple[int, PlannedRun]]:
    """Each run, and the place of its seed among the grid's.

    Raises:
        BootifolError: a task, a method, a preset, a field or a value is none.
    """
    for task in grid.tasks:
        if ":" not in task and not names_code(task):  # others' are made where they are acted in
            task_named(task)
    for method in grid.methods:
        if method != RANDOM and not names_code(method):
            check_method(method)
    if grid.time_budget is not None:
        parse_duration(grid.time_budget)
    for number, seed in enumerate(grid.seeds):
        for task in grid.tasks:
            for method in grid.methods:
                for preset_name in grid.presets:
                    preset(preset_name)
                    for variant, overrides in grid.variants.items():
                        run = PlannedRun(
                            task,
                            method,
                            preset_name,
                            _variant_name(grid, preset_name, variant),
                            overrides,
                            seed,
                            _demos(grid.demos, task),
                            grid.videos,
                            grid.time_budget,
                            grid.cpus,
                            grid.gpus,
                            grid.retries,
                        )
                        if number == 0:
                            _require_possible(run)
                        yield number, run


def _variant_name(grid: Grid, preset_name: str, variant: str) -> str:
    parts = [preset_name] if len(grid.presets) > 1 else []
    return "-".join([*parts, *([variant] if variant != DEFAULT else [])])


def _demos(pattern: str, task: str) -> Path:
    rest = pattern.replace("{task}", "")
    if "{" in rest or "}" in rest:
        raise BootifolError(f"demos is {shortened(pattern)}: {{task}} is all that is filled in")
    return Path(pattern.replace("{task}", short_name(task)))


def _require_possible(run: PlannedRun) -> None:
    config = run.config
    if run.time_budget is not None and run.method != RANDOM:
        require_time_to_act(config)
