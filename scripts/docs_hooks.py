"""What the site does to the pages: files of the repository that are no pages are named, not linked."""

from __future__ import annotations

import re
from typing import Any

_OUT_OF_DOCS = re.compile(r"(!?)\[([^\]]*)\]\(((?:\.\./)+(?!docs/)[^)#]*)(?:#[^)]*)?\)")


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links that leave `docs/` become their text and the file's path; pictures outside of it are left out."""
    depth = page.file.src_uri.count("/")

    def told(link: re.Match[str]) -> str:
        picture, text, target = link.groups()
        ups = target.count("../")
        if ups <= depth:
            return link[0]
        path = target.replace("../", "")
        return "" if picture else text if path in text else f"{text} (`{path}`)"

    return _OUT_OF_DOCS.sub(told, markdown)
