import sys

import pytest
from benchmarks.process_memory import status_bytes

from bootifol.errors import BootifolError


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_a_process_has_had_at_least_what_it_has() -> None:
    assert status_bytes("VmHWM") >= status_bytes("VmRSS") > 10**6
    with pytest.raises(BootifolError, match=r"does not say how much memory a process has \(VmNone\)"):
        status_bytes("VmNone")
