"""The `bootifol` command: one thin module a subcommand; errors are one sentence and exit code 2."""

from __future__ import annotations

import functools
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module, metadata
from typing import Any

import tyro
from rich.console import Console
from rich.text import Text

from bootifol.cli.help_texts import join_lines
from bootifol.errors import STOPPED, BootifolError, BootifolWarning, is_lack_of_memory, printable
from bootifol.output import output_may_fail
from bootifol.plugins import told

DESCRIPTION = """Videos in, policy out: learns a reward from videos of a task, and trains a pixel policy on it.

A first tour, about three minutes without a simulator:
  bootifol demos record --task drawn_home --episodes 150 \\
    --agent-size 32 --video-size 32 --out demos/drawn_home
  bootifol train --preset drawn --demos demos/drawn_home --out runs/first
  bootifol evaluate runs/first
  bootifol report runs/first

`bootifol doctor` says what this machine can do, `bootifol tasks` what there is to learn, `bootifol --version` which
version this is.
"""

DEMOS_DESCRIPTION = "Make, import, check, match and export sets of videos to learn from."
POLICY_DESCRIPTION = "Take a trained policy elsewhere."
EXPERTS_DESCRIPTION = "Train who performs a task in recordings, where none is bundled."

COMMANDS = {
    "doctor": (
        "bootifol.cli.doctor",
        "Say whether this machine can train: versions, cores, memory, the speed of learning and of rendering.",
    ),
    "tasks": (
        "bootifol.cli.tasks",
        "List the tasks, the lengths of their episodes, and the returns of their expert and of random actions.",
    ),
    "demos": (
        "",
        "Make, import, check, match and export sets of videos: demos record, import, check, match, export.",
    ),
    "train": (
        "bootifol.cli.train",
        "Learn a reward from videos and train a policy on it, or go on with an interrupted run.",
    ),
    "sweep": (
        "bootifol.cli.sweep",
        "Train tasks, methods, variants and seeds that a file names, on this machine's cores or on a Ray cluster.",
    ),
    "evaluate": (
        "bootifol.cli.evaluate",
        "Play episodes with the newest policy of one run or several, without exploration, and print their returns.",
    ),
    "score": (
        "bootifol.cli.score",
        "Reward videos with a run's learned reward: one number each, every step's in a CSV file or above film strips.",
    ),
    "report": (
        "bootifol.cli.report",
        "Write what one run learned, or several side by side, as one HTML file that opens in any browser.",
    ),
    "table": (
        "bootifol.cli.table",
        "Print the paper's result tables, scaled and absolute, with the returns of your runs beside the paper's.",
    ),
    "policy": (
        "",
        "Take a trained policy elsewhere, as an ONNX file or a folder for the Hugging Face hub: policy export.",
    ),
    "experts": ("", "Train an expert for recordings: experts train."),
}
"""Of each command the module whose function it is, and what it does: the first line of that function's docstring."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command.

    Args:
        arguments: without the program's name; the process's own by default.

    Returns:
        The exit code: 0, 2 after bad input, which one sentence explains, or 130 after an interruption.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    with output_may_fail(), warnings.catch_warnings():
        warnings.simplefilter("always", BootifolWarning)
        warnings.showwarning = functools.partial(_show_warning, warnings.showwarning)
        return _exit_code(words)


def _exit_code(words: list[str]) -> int:
    if words == ["--version"]:
        print(f"bootifol {metadata.version('bootifol')}")
        return 0
    try:
        if words[:1] == ["demos"]:
            return _run(_demos_commands(), words[1:], "bootifol demos", DEMOS_DESCRIPTION)
        if words[:1] == ["policy"]:
            return _run(_policy_commands(), words[1:], "bootifol policy", POLICY_DESCRIPTION)
        if words[:1] == ["experts"]:
            return _run(_experts_commands(), words[1:], "bootifol experts", EXPERTS_DESCRIPTION)
        return _run(_command_of(words), words, "bootifol", DESCRIPTION)
    except BootifolError as error:
        return _refused(str(error))
    except (MemoryError, RuntimeError) as error:
        if not is_lack_of_memory(error):
            raise
        return _refused(
            f"this needs more memory than the machine has ({told(error)}): choose fewer or smaller pictures, networks "
            "or batches"
        )
    except KeyboardInterrupt:
        Console(stderr=True).print("stopped")
        return STOPPED


def _refused(sentence: str) -> int:
    # Without emoji: rich would draw one for the middle of gymnasium:robot:Reach-v0.
    console = Console(stderr=True, soft_wrap=True, emoji=False)
    console.print(Text.assemble(("error:", "bold red"), f" {printable(sentence)}"))
    return 2


def _show_warning(otherwise: Callable[..., None], message: Warning | str, *where: Any) -> None:
    if isinstance(message, BootifolWarning):
        console = Console(stderr=True, soft_wrap=True, emoji=False)
        console.print(Text.assemble(("note:", "yellow"), f" {printable(str(message))}"))
    else:
        otherwise(message, *where)


def _run(commands: dict[str, Callable[..., int]], words: list[str], prog: str, description: str) -> int:
    for command in commands.values():
        join_lines(command)
    code: int = tyro.extras.subcommand_cli_from_dict(
        commands,
        prog=prog,
        description=description,
        args=["--help" if word == "--help-all" else word for word in words] or ["--help"],
        config=(tyro.conf.FlagConversionOff, tyro.conf.AvoidSubcommands),
    )
    return code


def _command_of(words: list[str]) -> dict[str, Callable[..., int]]:
    """All commands by name: the one that was typed as it is, of the others what they do, since importing each would
    keep the help waiting for PyTorch."""
    commands = {name: _placeholder(summary) for name, (_, summary) in COMMANDS.items()}
    if words and words[0] in COMMANDS:
        commands[words[0]] = _imported(words[0], words)
    return commands


def _imported(name: str, words: list[str]) -> Callable[..., int]:
    command: Callable[..., int] = getattr(import_module(COMMANDS[name][0]), name)
    if name == "train":
        from bootifol.cli.train import command_of

        return command_of(words)
    return command


def _placeholder(summary: str) -> Callable[..., int]:
    def command() -> int:
        raise NotImplementedError

    command.__doc__ = summary
    return command


def _demos_commands() -> dict[str, Callable[..., int]]:
    from bootifol.cli.demos import check, export, import_, match, record

    return {"record": record, "import": import_, "check": check, "match": match, "export": export}


def _policy_commands() -> dict[str, Callable[..., int]]:
    from bootifol.cli.policy import export

    return {"export": export}


def _experts_commands() -> dict[str, Callable[..., int]]:
    from bootifol.cli.experts import train

    return {"train": train}
