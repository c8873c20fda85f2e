"""`bootifol report`: what runs learned, as one HTML file."""

from __future__ import annotations

from pathlib import Path

from bootifol.cli.arguments import RunPaths


def report(runs: RunPaths, out: Path | None = None) -> int:
    """Write what one run learned, or several side by side, as one HTML file that opens in any browser.

    Args:
        runs: Directories that `bootifol train` wrote, or directories that hold some; a run in progress will do.
        out: The file to write; by default report.html in the one directory that was given, or else here.
    """
    # Imported here: matplotlib would slow down every other command's help.
    from bootifol.reports.html import report as write_report

    place = runs[0] if len(runs) == 1 and runs[0].is_dir() else Path()
    target = place / "report.html" if out is None else out
    print(f"report: {write_report(runs, target)}")
    return 0
