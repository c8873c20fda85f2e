"""Installs bootifol's wheel in empty environments and uses it there: each Python at hand, newest and lowest versions.

    python scripts/test_matrix.py                                # every python3.X that is on the path
    python scripts/test_matrix.py --pythons 3.11 --versions lowest --simulators

In each environment: `--version`, `tasks`, `doctor`, and a run from videos to a report with the preset `smoke`. PyTorch
from PyPI brings CUDA along on Linux, some gigabytes an environment; `--torch-index
https://download.pytorch.org/whl/cpu` takes it without.
"""

from __future__ import annotations

import argparse
import itertools
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PYTHONS = ("3.11", "3.12", "3.13")
VERSIONS = ("newest", "lowest")
EPISODES = "8"


def main() -> int:
    """Returns 0 when all of it works."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pythons", nargs="+", default=list(PYTHONS), metavar="3.X")
    parser.add_argument("--versions", nargs="+", choices=VERSIONS, default=list(VERSIONS))
    parser.add_argument(
        "--simulators", action="store_true", help="with dm-control, and pictures of Reacher Hard"
    )
    parser.add_argument("--torch-index", help="where PyTorch is taken from, too")
    arguments = parser.parse_args()
    outcomes = {}
    with tempfile.TemporaryDirectory() as directory:
        wheel = build_wheel(Path(directory))
        for python, versions in itertools.product(arguments.pythons, arguments.versions):
            outcomes[python, versions] = outcome = try_out(
                wheel, python, versions, arguments.simulators, arguments.torch_index
            )
            print(f"Python {python}, {versions}: {outcome}", flush=True)
    return 0 if all(outcome in ("works", "no such Python here") for outcome in outcomes.values()) else 1


def build_wheel(directory: Path) -> Path:
    """Of this checkout; built from a copy, so that nothing is left behind in it."""
    copy = directory / "copy"
    shutil.copytree(ROOT / "src", copy / "src", ignore=shutil.ignore_patterns("*.egg-info", "__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy / name)
    run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", directory, copy])
    (wheel,) = directory.glob("*.whl")
    return wheel


def try_out(wheel: Path, python: str, versions: str, simulators: bool, torch_index: str | None) -> str:
    """What came of it, in a word or the last line of what failed."""
    interpreter = shutil.which(f"python{python}")
    if interpreter is None or not works([interpreter, "--version"]):
        return "no such Python here"
    with tempfile.TemporaryDirectory() as directory:
        binaries = Path(directory) / "environment" / "bin"
        wanted = [f"{wheel}[dm-control]" if simulators else str(wheel)]
        if versions == "lowest":
            wanted += lowest_versions(("dm-control",) if simulators else ())
        if torch_index:
            wanted += ["--extra-index-url", torch_index]
        bootifol = binaries / "bootifol"
        demos, trained = ("demos", "run")
        task = "reacher_hard" if simulators else "drawn_home"
        record = ["demos", "record", "--task", task, "--episodes", EPISODES, "--out", demos]
        train = ["train", "--task", task, "--preset", "smoke", "--demos", demos, "--out", trained]
        try:
            run([interpreter, "-m", "venv", Path(directory) / "environment"])
            run([binaries / "pip", "install", "--quiet", *wanted])
            for words in (["--version"], ["tasks"], ["doctor"], record, train, ["report", trained]):
                run([bootifol, *words], directory)
        except subprocess.CalledProcessError as error:
            lines = (error.stderr or error.stdout or str(error)).strip().splitlines()
            return f"{' '.join(map(str, error.cmd[:4]))} failed: {lines[-1] if lines else error.returncode}"
        return "works"


def lowest_versions(extras: Sequence[str]) -> list[str]:
    """The lower bounds of pyproject.toml as requirements, such as `numpy==2.1`."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    groups = [project["dependencies"], *(project["optional-dependencies"][extra] for extra in extras)]
    bounds = [re.match(r"([\w.-]+)>=([\w.]+)", requirement) for requirement in itertools.chain(*groups)]
    return [f"{bound[1]}=={bound[2]}" for bound in bounds if bound]


def run(command: Sequence[object], directory: str | None = None) -> None:
    """Runs a command with nothing of this checkout on its path.

    Raises:
        subprocess.CalledProcessError: it failed; its output is kept.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    words = [str(word) for word in command]
    subprocess.run(words, cwd=directory, env=environment, check=True, capture_output=True, text=True)


def works(command: Sequence[str]) -> bool:
    """Whether a command exits with 0: a version manager may have left a name without a Python behind it."""
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


if __name__ == "__main__":
    raise SystemExit(main())
