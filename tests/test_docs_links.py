"""Every relative link and picture of the documentation resolves, and so does every anchor."""

from __future__ import annotations

import re
import sys
from collections import Counter
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "results").rglob("*.md")])

_FENCED = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^)\s]+)[^)]*\)")
_HEADING = re.compile(r"^#{1,6} +(.+?) *#*$", re.MULTILINE)
_PAGE_IN_CODE = re.compile(r"\bdocs/[\w/]+\.md\b")


def without_code(text: str) -> str:
    """The text less its blocks of code, in which # begins a comment."""
    return _FENCED.sub("", text)


def slug(heading: str) -> str:
    """A heading's anchor as GitHub makes it: lower case, spaces as hyphens, no punctuation and no markup."""
    shown = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
    kept = (sign for sign in shown if sign.isalnum() or sign in " -_")
    return "".join(kept).replace(" ", "-")


@cache
def anchors(page: Path) -> frozenset[str]:
    """The anchors of a page; headings of one name are numbered from the second on."""
    seen: Counter[str] = Counter()
    found = set()
    for heading in _HEADING.findall(without_code(page.read_text())):
        name = slug(heading)
        found.add(f"{name}-{seen[name]}" if seen[name] else name)
        seen[name] += 1
    return frozenset(found)


def broken(page: Path) -> list[str]:
    """The page's links that lead nowhere; addresses on the web are not tried."""
    found = []
    for link in _LINK.findall(without_code(page.read_text())):
        if re.match(r"[a-z][a-z+.-]*:", link):
            continue
        path, _, anchor = unquote(link).partition("#")
        target = (page.parent / path).resolve() if path else page
        missing = not target.exists() or not target.is_relative_to(ROOT)
        if missing or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            found.append(link)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_resolves(page: Path) -> None:
    assert broken(page) == []


def test_a_broken_path_and_a_broken_anchor_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    (tmp_path / "other.md").write_text(
        "# What `make` does, twice\n\n```\n# no heading\n```\n\n## Same\n\n## Same\n"
    )
    page = tmp_path / "page.md"
    good = "[a](other.md#what-make-does-twice) [`b`](other.md#same-1) [c](https://example.org/x.md) [d](other.md)"
    page.write_text(f"{good}\n\n```\n[not a link](nowhere.md)\n```\n")
    assert broken(page) == []

    page.write_text("[a](other.md#no-heading) ![b](picture.png) [c](other.md#same-2) [d](#here)\n")
    assert broken(page) == ["other.md#no-heading", "picture.png", "other.md#same-2", "#here"]


def test_pages_named_in_code_exist() -> None:
    named = {
        page
        for folder in ("src", "tests", "benchmarks")
        for file in (ROOT / folder).rglob("*.py")
        for page in _PAGE_IN_CODE.findall(file.read_text())
    } | set(_PAGE_IN_CODE.findall((ROOT / "CHANGELOG.md").read_text()))
    assert named
    assert [page for page in sorted(named) if not (ROOT / page).is_file()] == []


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached, waiting = set(), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page in reached:
            continue
        reached.add(page)
        for link in _LINK.findall(without_code(page.read_text())):
            target = (page.parent / link.partition("#")[0]).resolve()
            if target.suffix == ".md" and target.is_file():
                waiting.append(target)
    assert [page for page in sorted((ROOT / "docs").rglob("*.md")) if page not in reached] == []
