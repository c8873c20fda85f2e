"""Figures of how the library is built: how much code a training step runs through, how deep imports go, how many
settings a run has, how large each room is, and how much of it says what it does.

    python scripts/house.py            the library that `import bootifol` finds

A training step is traced in a tiny run of `drawn_reach`: the functions that one episode after the warm-up calls.
"""

from __future__ import annotations

import ast
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

from rich.console import Console

import bootifol
from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.presets import PRESETS, SMOKE
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer
from bootifol.types import StepMetrics

PACKAGE = Path(bootifol.__file__).parent
SIMULATORS = "envs"
"""A training step passes through the simulator; who reads how it learns, does not."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def main() -> None:
    """Prints a table in Markdown."""
    step = training_step()
    files = {path for path, _ in step}
    chain = longest_chain()
    settings = [name for name, _ in leaves(SMOKE)]
    by_preset = [dict(leaves(config)) for config in PRESETS.values()]
    default = dict(leaves(type(SMOKE)()))
    unset = [name for name in settings if all(preset[name] == default[name] for preset in by_preset)]
    documented, returning = fractions()
    rows = [
        ("lines of a training step", str(sum(step.values()))),
        ("its files", str(len(files))),
        ("import depth", str(len(chain))),
        ("settings", str(len(settings))),
        ("settings that no preset sets", str(len(unset))),
        ("lines", f"{sum(rooms().values()):,}"),
        ("public functions and classes with a docstring", f"{documented:.0%}"),
        ("functions with a return type", f"{returning:.0%}"),
    ]
    print("| | |\n|---|---|")
    for name, value in rows:
        print(f"| {name} | {value} |")
    print("\n| Room | Lines |\n|---|---|")
    for room, lines in rooms().most_common():
        print(f"| {room} | {lines:,} |")
    print("\na training step:")
    by_file: dict[Path, int] = defaultdict(int)
    for (path, _), lines in step.items():
        by_file[path] += lines
    for path, lines in sorted(by_file.items(), key=lambda item: -item[1]):
        print(f"  {lines:4} {path.relative_to(PACKAGE)}")
    print("\nthe longest chain of imports:", " → ".join(chain))
    print("\nsettings that no preset sets:", ", ".join(unset))


def training_step() -> Counter[tuple[Path, str]]:
    """Lines of code of each function that a training step calls, by file and name."""
    pictures = PictureConfig(agent_size=32, video_size=32)
    config = replace(
        SMOKE,
        pictures=pictures,
        device="cpu",
        threads=1,
        agent=replace(SMOKE.agent, encoder="strided", warm_up_steps=60, update_every=2, replay_capacity=600),
        alignment=replace(SMOKE.alignment, gradient_steps=2),
        interactive=replace(SMOKE.interactive, agent_steps=120, reward_update_every=20, agent_videos=6),
        demonstrations=replace(SMOKE.demonstrations, fraction=0.0),
        evaluation=replace(SMOKE.evaluation, every=10_000),
    )
    called: set[tuple[str, int]] = set()

    def note(frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            called.add((frame.f_code.co_filename, frame.f_code.co_firstlineno))

    with tempfile.TemporaryDirectory() as directory:
        demos = Path(directory, "demos")
        for behavior in ("expert", "random"):
            record("drawn_reach", behavior, 12, demos / behavior, pictures)
        run = Trainer(
            RunConfig("drawn_reach", "bootifol", "smoke", 1, str(demos), None, config),
            Path(directory, "run"),
            Console(quiet=True),
        )
        play = run.interactive.play_episode

        def traced() -> list[StepMetrics]:
            after_warm_up = run.counters.agent_steps >= config.agent.warm_up_steps
            sys.setprofile(note if after_warm_up else None)
            try:
                return play()
            finally:
                sys.setprofile(None)

        run.interactive.play_episode = traced  # type: ignore[method-assign]
        run.learn()
    found: Counter[tuple[Path, str]] = Counter()
    for path in modules():
        if path.relative_to(PACKAGE).parts[0] == SIMULATORS:
            continue
        for function in functions(path):
            first = min([function.lineno, *(decorator.lineno for decorator in function.decorator_list)])
            if (str(path), first) in called:
                found[path, f"{function.name}:{first}"] = code_lines(path, function)
    return found


def code_lines(path: Path, function: Function) -> int:
    """Lines of a function without its docstring, comments and blank lines."""
    first = function.body[0]
    told: range = range(0)
    if ast.get_docstring(function, clean=False) is not None:
        told = range(first.lineno, (first.end_lineno or first.lineno) + 1)
    lines = path.read_text().splitlines()
    assert function.end_lineno is not None
    return sum(
        bool(text := lines[number - 1].strip()) and not text.startswith("#") and number not in told
        for number in range(function.lineno, function.end_lineno + 1)
    )


def longest_chain() -> list[str]:
    """Modules of which each imports the next when it is imported; the longest there is."""

    @cache
    def below(module: str) -> list[str]:
        chains = [below(name) for name in imported(by_name[module]) if name in by_name and name != module]
        return [module, *max(chains, key=len, default=[])]

    by_name = {name_of(path): path for path in modules() if path.name != "__init__.py"}
    return max(map(below, by_name), key=len)


def imported(path: Path) -> Iterator[str]:
    """What a module imports at its top."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{name.name}" for name in node.names)
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


def leaves(config: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Names and values of all fields that are no configuration themselves."""
    for field in fields(config):
        value = getattr(config, field.name)
        if is_dataclass(value):
            yield from leaves(value, f"{prefix}{field.name}.")
        else:
            yield f"{prefix}{field.name}", value


def rooms() -> Counter[str]:
    """Lines by the directory they are in; the modules beside them together."""
    lines: Counter[str] = Counter()
    for path in modules():
        inside = path.relative_to(PACKAGE).parts
        lines[inside[0] if len(inside) > 1 else "beside the rooms"] += len(path.read_text().splitlines())
    return lines


def fractions() -> tuple[float, float]:
    """Of public functions and classes, those with a docstring; of all functions, those with a return type."""
    told, typed = [], []
    for path in modules():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, Function):
                typed.append(node.returns is not None)
            if isinstance(node, Function | ast.ClassDef) and not node.name.startswith("_"):
                told.append(ast.get_docstring(node) is not None)
    return sum(told) / len(told), sum(typed) / len(typed)


def functions(path: Path) -> Iterator[Function]:
    """All of a module's, methods too; not those inside another."""
    for node in ast.parse(path.read_text()).body:
        for inner in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(inner, Function):
                yield inner


def modules() -> list[Path]:
    """The library's."""
    return sorted(PACKAGE.rglob("*.py"))


def name_of(path: Path) -> str:
    """`bootifol.demos.record` for its file."""
    return ".".join(["bootifol", *path.relative_to(PACKAGE).with_suffix("").parts])


if __name__ == "__main__":
    main()
