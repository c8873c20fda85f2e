"""How much memory a process has, as Linux tells it."""

from __future__ import annotations

from pathlib import Path

from bootifol.errors import BootifolError


def status_bytes(name: str, process: int | str = "self") -> int:
    """A line of a process's /proc/PID/status in bytes: VmRSS is what it has now, VmHWM what it had at most.

    Not `ru_maxrss`, which on Linux begins with what the process that started this one had.

    Raises:
        BootifolError: the system has no such file or line.
    """
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith(f"{name}:"):
            return int(line.split()[1]) * 1024
    raise BootifolError(f"the system does not say how much memory a process has ({name}): run this on Linux")
