from __future__ import annotations

import subprocess
import sys

import pytest

PAGE_FAULTS = """
import resource, sys
from bootifol.memory import keep_freed_memory

def page_faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

if "keep" in sys.argv:
    assert keep_freed_memory()
for _ in range(3):
    before = page_faults()
    blocks = [bytearray(20 << 20) for _ in range(5)]
    del blocks
print(page_faults() - before)
"""


def _page_faults(*arguments: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", PAGE_FAULTS, *arguments], capture_output=True, text=True, check=True
    )
    return int(done.stdout)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a setting of glibc")
def test_freed_memory_is_reused_without_page_faults() -> None:
    pages = 5 * (20 << 20) // 4096
    assert _page_faults() > pages / 2
    assert _page_faults("keep") < pages / 100
