import pytest

from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.tasks import make_environment


@pytest.fixture(scope="session")
def requires_rendering() -> None:
    """Skips where OpenGL is missing; a machine that can render runs every test."""
    try:
        make_environment("reacher_hard", PictureConfig(agent_size=8, video_size=8), 1).close()
    except BootifolError as error:
        pytest.skip(str(error))
