"""Tables 1 and 5 of the paper: scaled and absolute returns on DeepMind Control.

    python -m benchmarks.table_dm_control runs/reacher_hard runs/hopper_stand --out results/dm_control.md

`bootifol table` for these tasks alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.command import command
from benchmarks.table_command import write_table
from bootifol.reports.paper_results import DM_CONTROL


@command()
def main(arguments: Sequence[str] | None = None) -> None:
    write_table(__doc__, DM_CONTROL, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
