import numpy as np
import pytest

from bootifol.envs.pictures import PictureConfig, resize
from bootifol.errors import BootifolError


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"agent_size": 7}, "agent_size must be at least 8, not 7"),
        ({"video_size": 2000}, "video_size must be at most 1,024, not 2000"),
        ({"stack": 0}, "stack must be at least 1, not 0"),
        ({"profile": "pretty"}, r"pictures\.profile must be fast, balanced or full, not 'pretty'"),
    ],
)
def test_impossible_pictures_are_refused_with_a_sentence(fields: dict[str, object], sentence: str) -> None:
    with pytest.raises(BootifolError, match=sentence):
        PictureConfig(**fields)  # type: ignore[arg-type]


def test_the_larger_size_is_rendered() -> None:
    assert PictureConfig(agent_size=84, video_size=64).picture_size == 84
    assert PictureConfig(agent_size=64, video_size=128).picture_size == 128


def test_resizing_averages_the_area_a_pixel_covers() -> None:
    picture = np.zeros((4, 4, 3), np.uint8)
    picture[:2, :2, 0] = [[0, 40], [80, 120]]
    picture[2:, 2:] = 200
    small = resize(picture, 2)
    assert small.dtype == np.uint8
    assert small.tolist() == [[[60, 0, 0], [0, 0, 0]], [[0, 0, 0], [200, 200, 200]]]


def test_a_picture_of_the_right_size_is_not_copied() -> None:
    picture = np.zeros((8, 8, 3), np.uint8)
    assert resize(picture, 8) is picture
