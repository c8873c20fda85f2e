"""The Python files that a page of the documentation shows, so that what is tested and measured is what is read."""

from __future__ import annotations

import re
from pathlib import Path

_DOCS = Path(__file__).parents[1] / "docs"
ADD_A_METHOD = _DOCS / "add_a_method.md"
USE_A_POLICY = _DOCS / "use_a_policy.md"


def write_page_modules(page: Path, directory: Path) -> list[Path]:
    """Writes every Python block of a page that begins with a line `# name.py` as that file.

    Args:
        page: in Markdown.
        directory: to write to, made where there is none.

    Returns:
        The files, in the page's order.
    """
    directory.mkdir(parents=True, exist_ok=True)
    files = []
    for name, code in re.findall(r"^```python\n# (\w+\.py)\n(.*?)^```$", page.read_text(), re.M | re.S):
        files.append(directory / name)
        files[-1].write_text(code)
    return files
