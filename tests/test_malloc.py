from __future__ import annotations

import subprocess
import sys

import pytest

PAGE_FAULTS = """
import resource, sys
from bootifol.malloc import keep_freed_memory

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


FULL_STORES = """
from pathlib import Path
import numpy as np
from bootifol.replay.agent_videos import AgentVideos
from bootifol.malloc import keep_freed_memory
from bootifol.replay.buffer import ReplayBuffer
from bootifol.types import Episode, Video

def resident():
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmRSS"))
    return 1024 * int(line.split()[1])

keep_freed_memory()
frames = np.ones((61, 64, 64, 3), np.uint8)
episode = Episode(frames, np.zeros((60, 2), np.float32), Video("same", frames), False)
before = resident()
replay, videos = ReplayBuffer(61 * 80, 64, 2), AgentVideos(40, 61, 64)
for _ in range(80):
    replay.add(episode, np.zeros(60, np.float32))
    videos.add(episode.video)
announced = ReplayBuffer.bytes_needed(61 * 80, 64, 2) + AgentVideos.bytes_needed(40, 61, 64)
print((resident() - before) / announced)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_full_stores_take_the_memory_that_a_run_announces() -> None:
    done = subprocess.run([sys.executable, "-c", FULL_STORES], capture_output=True, text=True, check=True)
    assert float(done.stdout) == pytest.approx(1.0, abs=0.1)
