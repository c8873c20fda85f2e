"""Tables as Markdown."""

from __future__ import annotations

from collections.abc import Sequence


def markdown_table(
    header: Sequence[str], lines: Sequence[Sequence[str]], rule: Sequence[str] | None = None
) -> str:
    """A table; `rule` is what stands below the header, such as `---:` where a column is numbers."""
    under = ["---"] * len(header) if rule is None else rule
    return "\n".join(f"| {' | '.join(line)} |" for line in (header, under, *lines))
