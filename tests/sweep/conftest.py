from __future__ import annotations

from pathlib import Path

import pytest

from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig


@pytest.fixture(scope="session")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Videos of drawn_home, of 32x32 pixels."""
    directory = tmp_path_factory.mktemp("recorded")
    pictures = PictureConfig(agent_size=32, video_size=32)
    for behavior in ("expert", "random", "half_good"):
        record("drawn_home", behavior, 12, directory / behavior, pictures)
    return directory
