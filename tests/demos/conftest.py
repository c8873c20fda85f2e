from pathlib import Path

import pytest
from small_demo_sets import WriteSet, set_writer


@pytest.fixture
def write_set(tmp_path: Path) -> WriteSet:
    return set_writer(tmp_path)
