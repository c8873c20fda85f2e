from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bootifol.demos import augmentation
from bootifol.demos.augmentation import AugmentationConfig, augment, augmented
from bootifol.errors import BootifolError
from bootifol.replay.agent_videos import AgentVideos
from bootifol.types import FrameBatch, Video


@pytest.fixture
def vary(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Sets by how much looks vary, in nothing but what is named."""

    def of(**strengths: float) -> None:
        for name in ("BRIGHTNESS", "CONTRAST", "NOISE", "BLUR"):
            monkeypatch.setattr(augmentation, name, strengths.get(name.lower(), 0.0))

    return of


def videos(count: int = 6, size: int = 8) -> FrameBatch:
    return np.random.default_rng(0).integers(60, 180, (count, 5, size, size, 3)).astype(np.uint8)


def test_nothing_to_vary_changes_nothing(vary: Callable[..., None]) -> None:
    vary()
    np.testing.assert_array_equal(augment(videos(), np.random.default_rng(1)), videos())


def test_each_video_has_one_brightness_and_contrast_of_its_own(vary: Callable[..., None]) -> None:
    vary(brightness=12.0, contrast=0.1)
    before = videos()
    after = augment(before, np.random.default_rng(1)).astype(float)
    lines = []
    for video, varied in zip(before.astype(float), after, strict=True):
        for color in range(3):
            slope, offset = np.polyfit(video[..., color].ravel(), varied[..., color].ravel(), 1)
            # Whole levels: a line fits every frame of the video to half a level.
            assert np.abs(slope * video[..., color] + offset - varied[..., color]).max() < 0.75
            assert abs(slope - 1) < 0.16 and abs(offset) < 12 * 1.5 + 1
            lines.append((round(slope, 3), round(offset, 1)))
    assert len(set(lines)) == len(lines)


def test_noise_is_another_in_every_frame_and_no_stronger_than_asked_for(vary: Callable[..., None]) -> None:
    vary(noise=4.0)
    before = np.full((20, 4, 16, 16, 3), 128, np.uint8)
    after = augment(before, np.random.default_rng(1)).astype(float)
    spread = (after - 128).std((1, 2, 3, 4))
    assert spread.max() < 4.2 and spread.min() < 2 < spread.max()
    loud = after[int(spread.argmax())]
    assert abs(np.corrcoef(loud[0].ravel(), loud[1].ravel())[0, 1]) < 0.2


def test_blur_is_the_binomial_filter_of_whole_videos(vary: Callable[..., None]) -> None:
    vary(blur=1.0)
    one = np.zeros((1, 2, 5, 5, 3), np.uint8)
    one[:, :, 2, 2] = 160
    blurred = augment(one, np.random.default_rng(1))
    kernel = np.outer([1, 2, 1], [1, 2, 1]) * 10
    np.testing.assert_array_equal(blurred[0, 1, 1:4, 1:4, 0], kernel)
    flat = np.full((1, 2, 4, 4, 3), 77, np.uint8)
    np.testing.assert_array_equal(augment(flat, np.random.default_rng(1)), flat)
    vary(blur=0.5)
    half = augment(one.repeat(200, 0), np.random.default_rng(1))
    assert 60 < (half[:, 0, 2, 2, 0] == 160).sum() < 140


def test_samples_vary_and_single_videos_do_not() -> None:
    ring = AgentVideos(4, 5, 8)
    for index, frames in enumerate(videos(4)):
        ring.add(Video(f"episode-{index}", frames))
    varied = augmented(ring, True)
    assert len(varied) == 4
    np.testing.assert_array_equal(varied[2].frames, ring[2].frames)
    drawn = varied.sample(3, np.random.default_rng(5))
    assert drawn.shape == (3, 5, 8, 8, 3) and drawn.dtype == np.uint8
    np.testing.assert_array_equal(drawn, varied.sample(3, np.random.default_rng(5)))
    assert (drawn != ring.sample(3, np.random.default_rng(5))).mean() > 0.5
    assert augmented(ring, False) is ring


def test_imported_videos_vary_where_recorded_ones_do_not() -> None:
    assert AugmentationConfig("imported").applies(imported=True)
    assert not AugmentationConfig("imported").applies(imported=False)
    assert AugmentationConfig("always").applies(imported=False)
    assert not AugmentationConfig().applies(imported=True)


def test_another_time_gets_a_sentence() -> None:
    with pytest.raises(
        BootifolError, match=r"augmentation\.when must be never, imported or always, not 'often'"
    ):
        AugmentationConfig("often")  # type: ignore[arg-type]
