from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bootifol.demos.augmentation import AugmentationConfig, augment, augmented
from bootifol.errors import BootifolError
from bootifol.replay.agent_videos import AgentVideos
from bootifol.types import FrameBatch, Video

STILL = AugmentationConfig("always", brightness=0, contrast=0, noise=0, blur=0)


def videos(count: int = 6, size: int = 8) -> FrameBatch:
    return np.random.default_rng(0).integers(60, 180, (count, 5, size, size, 3)).astype(np.uint8)


def test_nothing_to_vary_changes_nothing() -> None:
    np.testing.assert_array_equal(augment(videos(), STILL, np.random.default_rng(1)), videos())


def test_each_video_has_one_brightness_and_contrast_of_its_own() -> None:
    config = replace(STILL, brightness=12.0, contrast=0.1)
    before = videos()
    after = augment(before, config, np.random.default_rng(1)).astype(float)
    lines = []
    for video, varied in zip(before.astype(float), after, strict=True):
        for color in range(3):
            slope, offset = np.polyfit(video[..., color].ravel(), varied[..., color].ravel(), 1)
            # Whole levels: a line fits every frame of the video to half a level.
            assert np.abs(slope * video[..., color] + offset - varied[..., color]).max() < 0.75
            assert abs(slope - 1) < 0.16 and abs(offset) < 12 * 1.5 + 1
            lines.append((round(slope, 3), round(offset, 1)))
    assert len(set(lines)) == len(lines)


def test_noise_is_another_in_every_frame_and_no_stronger_than_asked_for() -> None:
    before = np.full((20, 4, 16, 16, 3), 128, np.uint8)
    after = augment(before, replace(STILL, noise=4.0), np.random.default_rng(1)).astype(float)
    spread = (after - 128).std((1, 2, 3, 4))
    assert spread.max() < 4.2 and spread.min() < 2 < spread.max()
    loud = after[int(spread.argmax())]
    assert abs(np.corrcoef(loud[0].ravel(), loud[1].ravel())[0, 1]) < 0.2


def test_blur_is_the_binomial_filter_of_whole_videos() -> None:
    one = np.zeros((1, 2, 5, 5, 3), np.uint8)
    one[:, :, 2, 2] = 160
    blurred = augment(one, replace(STILL, blur=1.0), np.random.default_rng(1))
    kernel = np.outer([1, 2, 1], [1, 2, 1]) * 10
    np.testing.assert_array_equal(blurred[0, 1, 1:4, 1:4, 0], kernel)
    flat = np.full((1, 2, 4, 4, 3), 77, np.uint8)
    np.testing.assert_array_equal(augment(flat, replace(STILL, blur=1.0), np.random.default_rng(1)), flat)
    half = augment(one.repeat(200, 0), replace(STILL, blur=0.5), np.random.default_rng(1))
    assert 60 < (half[:, 0, 2, 2, 0] == 160).sum() < 140


def test_samples_vary_and_single_videos_do_not() -> None:
    ring = AgentVideos(4, 5, 8)
    for index, frames in enumerate(videos(4)):
        ring.add(Video(f"episode-{index}", frames))
    varied = augmented(ring, AugmentationConfig("always"))
    assert len(varied) == 4
    np.testing.assert_array_equal(varied[2].frames, ring[2].frames)
    drawn = varied.sample(3, np.random.default_rng(5))
    assert drawn.shape == (3, 5, 8, 8, 3) and drawn.dtype == np.uint8
    np.testing.assert_array_equal(drawn, varied.sample(3, np.random.default_rng(5)))
    assert (drawn != ring.sample(3, np.random.default_rng(5))).mean() > 0.5
    assert augmented(ring, None) is ring


def test_imported_videos_vary_where_recorded_ones_do_not() -> None:
    assert AugmentationConfig("imported").applies(imported=True)
    assert not AugmentationConfig("imported").applies(imported=False)
    assert AugmentationConfig("always").applies(imported=False)
    assert not AugmentationConfig().applies(imported=True)


@pytest.mark.parametrize(("name", "value"), [("noise", -1.0), ("blur", 2.0), ("contrast", 0.9)])
def test_values_that_make_no_sense_get_a_sentence(name: str, value: float) -> None:
    with pytest.raises(BootifolError, match=name):
        AugmentationConfig(**{name: value})
