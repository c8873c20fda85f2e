"""Methods and tasks that installed packages bring, under names of their own: the entry points `bootifol.methods` and
`bootifol.tasks`. To know their names imports nothing of theirs; `own_modules` imports the one that is named."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import Literal

PluginKind = Literal["method", "task"]

GROUPS: dict[PluginKind, str] = {"method": "bootifol.methods", "task": "bootifol.tasks"}


def plugins(kind: PluginKind) -> dict[str, list[EntryPoint]]:
    """What installed packages bring, by name in alphabetical order; more than one where packages share a name.

    A name with a colon is none, for it would be read as MODULE:NAME. Names of the library's own go before.
    """
    found: dict[str, list[EntryPoint]] = {}
    for entry in sorted(entry_points(group=GROUPS[kind]), key=lambda entry: (entry.name, package_of(entry))):
        if ":" not in entry.name:
            found.setdefault(entry.name, []).append(entry)
    return found


def package_of(entry: EntryPoint) -> str:
    """Name and version of the package that brings it."""
    return "an unnamed package" if entry.dist is None else f"{entry.dist.name} {entry.dist.version}"


def names_of_plugins(kind: PluginKind) -> str:
    """For a sentence that lists what there is, after the library's own names; nothing where there are none."""
    return "".join(f", {name}" for name in plugins(kind))
