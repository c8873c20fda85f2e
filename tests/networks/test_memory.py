import platform
import subprocess
import sys

import pytest

SCRIPT = """
import resource
from bootifol.networks.memory import keep_freed_memory
keep_freed_memory()
import torch
torch.zeros(2**23)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    torch.zeros(2**23)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc returns memory so eagerly")
def test_freed_tensors_are_not_asked_for_again() -> None:
    result = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert int(result.stdout) < 100  # pages; ten tensors of 32 MB are 81,920 pages of 4 KB, or 160 of 2 MB
