"""Code that users bring: modules of their own, named as `MODULE:NAME`, and what installed packages bring under names of
their own, by the entry points `bootifol.methods` and `bootifol.tasks`. Both are environments and reward methods.

To know the names that packages bring imports nothing of theirs. A name that a person typed is imported; one that stands
in a file is not, unless a person allows it: the file may be a stranger's.
"""

from __future__ import annotations

import importlib
import sys
import traceback
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Literal

from bootifol.errors import BootifolError, shortened

PluginKind = Literal["method", "task"]

GROUPS: dict[PluginKind, str] = {"method": "bootifol.methods", "task": "bootifol.tasks"}

_allowed: set[str] = set()
"""Names that were imported in this process already, so somebody typed or trusted them."""


def is_own_name(name: str) -> bool:
    """Whether a name has the form MODULE:NAME, such as my_package.my_module:make."""
    module_name, colon, attribute = name.partition(":")
    return bool(colon) and all(part.isidentifier() for part in (*module_name.split("."), attribute))


def imports_code(name: str) -> bool:
    """Whether Python imports a module to make what a task or a method names: MODULE:NAME, gymnasium:PACKAGE:ID, or what
    an installed package brings."""
    return ":" in name.removeprefix("gymnasium:") or any(name in plugins(kind) for kind in GROUPS)


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


def require_trust(path: Path, what: str, name: str, trust: bool) -> None:
    """Refuses a name out of a file that would be imported, unless a person typed it in this process, or trusts it.

    Args:
        path: the file.
        what: it names, such as "task".
        name: what it is called.
        trust: whether a person allowed that what the file names is imported.

    Raises:
        BootifolError: nobody did.
    """
    if imports_code(name) and not trust and name not in _allowed:
        raise BootifolError(
            f"{path} names the {what} {name!r}, which is code of its author's, and none of it was run: if you know "
            "that code and trust it, add --trust (from Python trust=True)"
        )


def allow(name: str) -> None:
    """Remembers a name that is about to be imported: who asked for it once need not say so again."""
    _allowed.add(name)


def own_callable(name: str, kind: str, plugin: PluginKind | None = None) -> Callable[..., Any]:
    """Imports what a user's `MODULE:NAME` names; the module may lie in the current directory.

    Args:
        name: for which `is_own_name` holds, or that an installed package brings.
        kind: what it should be, for messages.
        plugin: what packages may bring under a name; None where they bring nothing.

    Raises:
        BootifolError: there is no such module, it cannot be imported, or it has nothing callable of that name.
    """
    if plugin is not None and not is_own_name(name):
        return _of_a_package(name, kind, plugin)
    module_name, _, attribute = name.partition(":")
    if _is_of_python(module_name):
        raise BootifolError(
            f"{name} is no {kind}: {module_name} is a part of Python itself; name a module of your own"
        )
    allow(name)
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{module_name}.".startswith(f"{error.name}."):
            raise BootifolError(
                f"there is no module {error.name} for {name}, neither in {here} nor among the installed packages: "
                "go to the directory it lies in, or install it"
            ) from error
        raise BootifolError(f"{name} needs a package that is missing: {told(error)}; install it") from error
    except (Exception, SystemExit) as error:  # a module may do anything when it is imported
        raise BootifolError(f"{module_name} cannot be imported: {told(error)}{where(error)}") from error
    found = getattr(module, attribute, None)
    if not callable(found):
        own = [key for key, value in vars(module).items() if _is_own(value, module_name)]
        there = f"; it has {', '.join(own)}" if own else ""
        raise BootifolError(f"the module {module_name} has no {kind} {attribute}{there}")
    made: Callable[..., Any] = found
    return made


def _of_a_package(name: str, kind: str, plugin: PluginKind) -> Callable[..., Any]:
    entries = plugins(plugin)[name]
    if len(entries) > 1:
        raise BootifolError(
            f"{' and '.join(map(package_of, entries))} both bring a {kind} {name}: write {entries[0].value} or "
            f"{entries[1].value} for the one that you want"
        )
    (entry,) = entries
    allow(name)
    try:
        found = entry.load()
    except (Exception, SystemExit) as error:  # a package may do anything when it is imported
        raise BootifolError(
            f"the {kind} {name} of {package_of(entry)} cannot be imported: {told(error)}{where(error)}"
        ) from error
    if not callable(found):
        raise BootifolError(
            f"the {kind} {name} of {package_of(entry)} cannot be called: it is {shortened(found)}"
        )
    made: Callable[..., Any] = found
    return made


def told(error: BaseException) -> str:
    """What an exception says, in one line; its type where it says nothing."""
    text = " ".join(str(error).split())
    return text or type(error).__name__


def where(error: BaseException) -> str:
    """File and line that an exception comes from."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f" ({type(error).__name__} in {Path(last.filename).name}, line {last.lineno})"


def _is_of_python(module_name: str) -> bool:
    """Whether a module belongs to Python's own library, which makes neither environments nor reward methods; a file of
    the same name in the current directory goes first."""
    top = module_name.partition(".")[0]
    in_the_way = Path(top).is_dir() or Path(f"{top}.py").is_file()
    return top in sys.builtin_module_names or (top in sys.stdlib_module_names and not in_the_way)


def _is_own(value: object, module_name: str) -> bool:
    return callable(value) and getattr(value, "__module__", None) == module_name
