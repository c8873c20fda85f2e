"""The Python files that a page of the documentation shows, so that what is tested and measured is what is read.

python -m benchmarks.page_modules docs/add_a_method.md       # writes them into the current directory
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from benchmarks.command import command
from bootifol.errors import BootifolError

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


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("page", type=Path, help="in Markdown")
    parser.add_argument("--out", type=Path, default=Path(), help="directory to write to (the current one)")
    arguments = parser.parse_args()
    if not arguments.page.is_file():
        raise BootifolError(f"there is no page {arguments.page}; name one such as {ADD_A_METHOD}")
    for file in write_page_modules(arguments.page, arguments.out):
        print(file)


if __name__ == "__main__":
    raise SystemExit(main())
