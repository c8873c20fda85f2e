import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bootifol.demos.scene_match import differences_of_looks, first_frames, write_first_frames
from bootifol.envs.pictures import PictureConfig
from bootifol.tasks import task_named

PICTURE = Path("demos/mine/first_frames.png")


def as_filmed(change: Callable[[np.ndarray], np.ndarray], pictures: np.ndarray) -> np.ndarray:
    return np.clip(change(pictures.astype(float)), 0, 255).round().astype(np.uint8)


@pytest.fixture(scope="module")
def starts() -> np.ndarray:
    return first_frames(task_named("drawn_home"), PictureConfig(agent_size=32, video_size=32))


@pytest.mark.parametrize("count", [1, 2, 5, 12])
def test_the_environment_looks_like_itself(starts: np.ndarray, count: int) -> None:
    assert differences_of_looks(starts[-count:], starts, PICTURE) == []


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda p: p + 15, "brighter than the environment by 15 levels of 255: change the exposure"),
        (lambda p: p - 10, "darker than the environment by"),
        (lambda p: p * [1.0, 1.0, 1.3], r"colors differ .*blue \+\d+ levels .* white balance"),
        (lambda p: (p - p.mean((0, 1, 2))) * 0.7 + p.mean((0, 1, 2)), "0.70 times the contrast"),
        (lambda p: np.roll(p, 2, axis=2), "things stand elsewhere .* look at demos/mine/first_frames.png"),
        (lambda p: p[:, :, ::-1], "things stand elsewhere"),
        (lambda p: p[:, ::-1], "things stand elsewhere"),
    ],
)
def test_each_distortion_is_named(
    starts: np.ndarray, change: Callable[[np.ndarray], np.ndarray], sentence: str
) -> None:
    found = differences_of_looks(as_filmed(change, starts[:8]), starts, PICTURE)
    with_sentence = [text for text in found if re.search(sentence, text)]
    assert len(with_sentence) == 1, found


def test_brightness_alone_is_not_called_a_camera(starts: np.ndarray) -> None:
    assert len(differences_of_looks(as_filmed(lambda p: p + 12, starts[:8]), starts, PICTURE)) == 1


def test_the_picture_shows_both_their_means_and_the_difference(tmp_path: Path) -> None:
    videos = np.full((3, 64, 64, 3), 200, np.uint8)
    environment = np.full((24, 64, 64, 3), 50, np.uint8)
    sheet = np.asarray(Image.open(write_first_frames(tmp_path, videos, environment)))
    step, top = 128 + 4, 4 + 22 + 64  # middle of the first row's pictures
    rows = [top + row * (128 + 22 + 4) for row in range(3)]
    middles = [4 + column * step + 64 for column in range(3)]
    assert sheet[rows[0], middles, 0].tolist() == [200, 200, 200]
    assert sheet[rows[1], middles, 0].tolist() == [50, 50, 50]
    assert sheet[rows[2], middles, 0].tolist() == [200, 50, 150]
    assert sheet.shape[1] == 8 * step + 4
