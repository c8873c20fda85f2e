"""Features of a demo set: computed once, kept by the checksum of the pixels."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from small_demo_sets import FRAMES, WriteSet, moving_videos

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.features import FeaturizedVideos, without_pixels
from bootifol.errors import BootifolError
from bootifol.types import Features, FeatureSource, Frames

VIDEOS = moving_videos(5)


class Means:
    """Mean color of each frame; counts frames, and may fail after some."""

    feature_size = 3

    def __init__(self, key: str = "means-8", fails_after: int = 10**9) -> None:
        self.key = key
        self.frames = 0
        self.fails_after = fails_after

    def features(self, frames: Frames) -> Features:
        if self.frames + len(frames) > self.fails_after:
            raise KeyboardInterrupt
        self.frames += len(frames)
        return frames.mean(axis=(1, 2)).astype(np.float32)


def expected(index: int) -> np.ndarray:
    return VIDEOS[index].mean(axis=(1, 2)).astype(np.float32)


def featurized(path: Path, means: Means) -> FeaturizedVideos:
    training, _ = DemoSet.open(path).split(0)
    return FeaturizedVideos(training, means)


def test_every_frame_is_computed_once(write_set: WriteSet) -> None:
    path, means = write_set(VIDEOS), Means()
    videos = featurized(path, means)
    assert isinstance(videos, FeatureSource) and len(videos) == 5
    videos.compute()
    assert means.frames == 5 * FRAMES
    for index in range(5):
        video = videos[index]
        np.testing.assert_array_equal(video.frames, VIDEOS[index])
        np.testing.assert_array_equal(video.features, expected(index))
    videos.compute()
    later = Means()
    featurized(path, later).compute()
    featurized(path, later)[3]
    assert (means.frames, later.frames) == (5 * FRAMES, 0)


def test_features_are_drawn_as_videos_are(write_set: WriteSet) -> None:
    videos = featurized(write_set(VIDEOS), Means())
    features = videos.sample_features(3, np.random.default_rng(4))
    frames = videos.sample(3, np.random.default_rng(4))
    np.testing.assert_array_equal(features, frames.mean(axis=(2, 3)).astype(np.float32))


def test_videos_held_out_are_computed_when_asked_for(write_set: WriteSet) -> None:
    means = Means()
    training, aside = DemoSet.open(write_set(VIDEOS)).split(2)
    FeaturizedVideos(training, means).compute()
    assert means.frames == 3 * FRAMES
    held_out = FeaturizedVideos(aside, means)
    np.testing.assert_array_equal(held_out[1].features, expected(aside.indices[1]))
    assert means.frames == 4 * FRAMES


def test_it_goes_on_where_it_stopped(write_set: WriteSet) -> None:
    path = write_set(VIDEOS)
    first, second = Means(fails_after=2 * FRAMES), Means()
    with pytest.raises(KeyboardInterrupt):
        featurized(path, first).compute()
    assert not list(path.rglob("*.tmp"))
    videos = featurized(path, second)
    videos.compute()
    assert (first.frames, second.frames) == (2 * FRAMES, 3 * FRAMES)
    np.testing.assert_array_equal(videos[4].features, expected(4))


def test_other_pixels_or_another_network_never_get_them(write_set: WriteSet) -> None:
    path = write_set(VIDEOS)
    featurized(path, Means()).compute()
    changed = VIDEOS.copy()
    changed[2] = 255 - changed[2]
    other = write_set(changed, "changed")
    shutil.copytree(path / "features", other / "features")
    means = Means()
    videos = featurized(other, means)
    videos.compute()
    assert means.frames == FRAMES  # the four unchanged videos are known by their pixels
    np.testing.assert_array_equal(videos[2].features, changed[2].mean(axis=(1, 2)).astype(np.float32))
    another_network = Means("means-of-another")
    featurized(path, another_network).compute()
    assert another_network.frames == 5 * FRAMES


def test_damage_is_refused(write_set: WriteSet) -> None:
    path = write_set(VIDEOS)
    videos = featurized(path, Means())
    videos.compute()
    file = next((path / "features" / "means-8").iterdir())
    whole = file.read_bytes()
    file.write_bytes(whole[:-4])
    with pytest.raises(
        BootifolError, match=f"the features of a video is damaged or incomplete: .*{file.name}"
    ):
        for index in range(5):
            videos[index]
    file.unlink()
    longer = featurized(path, Means())
    longer.featurizer.feature_size = 4
    with pytest.raises(BootifolError, match=r"does not hold float32 features \[5, 4\]; remove it"):
        for index in range(5):
            longer[index]


def test_pixels_that_are_not_the_recorded_ones_are_refused(write_set: WriteSet) -> None:
    path = write_set(VIDEOS, per_shard=5)
    shard = path / "shard-00000.npy"
    content = bytearray(shard.read_bytes())
    content[-1] ^= 1
    shard.write_bytes(content)
    with pytest.raises(BootifolError, match=r"drawn-expert-000004 in .* are not the ones recorded; restore"):
        featurized(path, Means()).compute()


def test_without_pixels_features_and_length_remain(write_set: WriteSet) -> None:
    videos = featurized(write_set(VIDEOS), Means())
    (light,) = without_pixels([videos[0]])
    assert light.frames.shape == (FRAMES, 0, 0, 3) and light.frames.base is None
    np.testing.assert_array_equal(light.features, expected(0))
