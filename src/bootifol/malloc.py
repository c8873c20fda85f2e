"""Memory that the C library keeps instead of giving it back after every gradient step.

A gradient step frees tensors of tens to hundreds of MB and asks for them again at once. By default glibc hands such
blocks back to the kernel, and each return costs a page fault per 4 KB: a fifth to a third of a step on the CPU.
"""

from __future__ import annotations

import ctypes
import os
import sys

# From glibc's malloc.h.
_TRIM_THRESHOLD = -1
_TOP_PAD = -2
_MMAP_MAX = -4


def keep_freed_memory() -> bool:
    """Makes freed memory stay with the process, and large tensors use 2 MB pages.

    Call it once, before the first tensor is made. It changes speed only; the process stays at its peak size.

    Returns:
        True where the C library is glibc and took the settings; elsewhere nothing happens.
    """
    os.environ.setdefault("THP_MEM_ALLOC_ENABLE", "1")  # read by PyTorch at its first allocation
    if not sys.platform.startswith("linux"):
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    settings = ((_MMAP_MAX, 0), (_TRIM_THRESHOLD, 2**31 - 1), (_TOP_PAD, 64 << 20))
    return all(mallopt(name, value) for name, value in settings)
