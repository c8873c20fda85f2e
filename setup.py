"""What pyproject.toml cannot say: the README as a package index shows it, which has no files for its links to lead to.

The project's address is not fixed yet, so links between its files cannot be made absolute: each becomes the name of the
page, as the source archive has it, and pictures are left out.
"""

from __future__ import annotations

import re
from pathlib import Path

from setuptools import setup

_CODE = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)
_PICTURE = re.compile(r"^!\[[^\]]*\]\((?!https?:)[^)]*\)\n\n?", re.MULTILINE)
_LINK = re.compile(r"\[([^\]]+)\]\((?!https?:)([^)#]*)(?:#[^)]*)?\)")


def for_package_index(text: str) -> str:
    """A page of Markdown without relative links and pictures; blocks of code stay as they are."""
    parts = _CODE.split(text)
    parts[::2] = [_LINK.sub(_named, _PICTURE.sub("", part)) for part in parts[::2]]
    return "".join(parts)


def _named(link: re.Match[str]) -> str:
    words, page = link[1], link[2]
    return words if not page or page in words else f"{words} ({page})"


if __name__ == "__main__":
    setup(
        long_description=for_package_index(Path(__file__).with_name("README.md").read_text(encoding="utf-8")),
        long_description_content_type="text/markdown",
    )
