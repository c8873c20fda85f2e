"""Tables 2 and 6 of the paper: scaled and absolute returns on Meta-World.

    python -m benchmarks.table_meta_world runs/button_press runs/drawer_close --out results/meta_world.md

`bootifol table` for these tasks alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.command import command
from benchmarks.table_command import write_table
from bootifol.reports.paper_results import META_WORLD


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    write_table(__doc__, META_WORLD, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
