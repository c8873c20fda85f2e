"""What operating systems and programs leave in every folder, and nobody means."""

from __future__ import annotations

from pathlib import Path

_NAMES = frozenset(
    {
        ".ds_store",
        "thumbs.db",
        "ehthumbs.db",
        "ehthumbs_vista.db",
        "desktop.ini",
        "icon\r",
        "__macosx",
        "$recycle.bin",
        "recycler",
        "system volume information",
        "lost+found",
        "@eadir",
        "#recycle",
        "__pycache__",
    }
)


def children(folder: Path) -> list[Path]:
    """What lies in a folder, without litter: hidden files, previews that systems keep, their bins and indexes."""
    return [child for child in folder.iterdir() if not is_litter(child)]


def is_litter(path: Path) -> bool:
    """Whether a name is that of a hidden file or of a system's own."""
    name = path.name.lower()
    if name.endswith(".icloud"):
        return False  # stands for a file that is not downloaded yet
    return name.startswith((".", "~$")) or name.endswith("~") or is_systems_own(path)


def is_systems_own(path: Path) -> bool:
    """Whether a name is one that a system gives to files of its own."""
    return path.name.lower() in _NAMES
