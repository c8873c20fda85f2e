"""What a run's numbers depend on beside its configuration: versions, the library's own code, processor, videos."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TypedDict

from bootifol.demos.manifest import find_demo_sets, read_manifest
from bootifol.errors import BootifolError

_PACKAGES = (
    "bootifol",
    "torch",
    "numpy",
    "mujoco",
    "dm-control",
    "metaworld",
    "gymnasium",
    "numba",
    "safetensors",
    "transformers",
)

_CHANGE_NO_NUMBER = {"cli", "reports"}
"""Parts of the library that pass words on, or read what runs have written."""

_DIGITS = 12
"""Hexadecimal digits of a digest that are kept: enough to tell versions apart, few enough to read."""


class Videos(TypedDict):
    """One demo set that a run learned from."""

    count: int
    digest: str
    """Of all pixels, whatever directory they lie in."""


def versions() -> dict[str, str]:
    """Versions of everything that a run's numbers depend on, with a digest of the library's own code."""
    found = {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "processor": processor(),
        "code": code_digest(),
    }
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


@cache
def code_digest() -> str:
    """Of all modules that learn; it changes with every edit of them, which the version of the package does not."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package)
        if name.parts[0] not in _CHANGE_NO_NUMBER:
            digest.update(name.as_posix().encode())
            digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()[:_DIGITS]


def processor() -> str:
    """The name of the processor as far as the system tells it: time budgets buy more on a faster one."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "") or platform.processor() or "unknown"


def videos_in(demos: Path) -> dict[str, Videos]:
    """The expert and the random videos in a directory, by who performs; nothing where there are none."""
    try:
        found = find_demo_sets(demos)
    except BootifolError:
        return {}
    described: dict[str, Videos] = {}
    for behavior in sorted(found.keys() & {"expert", "random"}):
        entries = read_manifest(found[behavior]).videos
        digest = hashlib.sha256("".join(entry.sha256 for entry in entries).encode())
        described[behavior] = {"count": len(entries), "digest": digest.hexdigest()[:_DIGITS]}
    return described
