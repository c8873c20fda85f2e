from __future__ import annotations

from pathlib import Path

import pytest
from tiny_runs import record_demos


@pytest.fixture(scope="session")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Expert, random and half-good videos of the drawn task."""
    return record_demos(tmp_path_factory.mktemp("demos"))
