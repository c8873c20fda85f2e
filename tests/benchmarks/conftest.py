from __future__ import annotations

from pathlib import Path

import pytest

from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig


@pytest.fixture(scope="session")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four expert and four random videos of drawn_home, of 32x32 pixels."""
    directory = tmp_path_factory.mktemp("demos")
    for behavior in ("expert", "random"):
        record("drawn_home", behavior, 4, directory / behavior, PictureConfig(agent_size=32, video_size=32))
    return directory
