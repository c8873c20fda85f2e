from __future__ import annotations

from pathlib import Path

import pytest
from tiny_runs import ENDS_SOON, new_run, record_demos


@pytest.fixture(scope="session")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Expert, random and half-good videos of the drawn task."""
    return record_demos(tmp_path_factory.mktemp("demos"))


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory, demos: Path) -> Path:
    """A short run that has ended, not to be changed."""
    directory = tmp_path_factory.mktemp("finished") / "run"
    assert new_run(directory, demos, config=ENDS_SOON).learn()
    return directory
