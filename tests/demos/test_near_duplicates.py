from pathlib import Path

import numpy as np
from test_video_statistics import walking_block
from tests.video_files.whole_videos import read_video

from bootifol.demos.near_duplicates import near_duplicates
from bootifol.demos.video_statistics import statistics_of
from bootifol.envs.pictures import centered_square
from bootifol.video_files.writing import write_video


def test_a_video_compressed_again_is_found(tmp_path: Path) -> None:
    videos = [walking_block(moves=range(start, 20)) for start in (1, 5, 9)]
    write_video(tmp_path / "again.mp4", videos[1], 10)
    again = np.stack([centered_square(frame, 32) for frame in read_video(tmp_path / "again.mp4")])
    assert (again != videos[1]).any()
    digests = np.stack([statistics_of(video).digest for video in [*videos, again]])
    assert near_duplicates(digests) == [[1, 3]]


def test_videos_that_differ_in_one_small_place_are_two() -> None:
    digests = np.full((2, 8, 16, 16, 3), 90, np.uint8)
    digests[1, 3, 4, 4] = 120
    assert near_duplicates(digests) == []
    digests[1, 3, 4, 4] = 100
    assert near_duplicates(digests) == [[0, 1]]


def test_groups_are_those_of_comparing_all_with_all() -> None:
    rng = np.random.default_rng(3)
    originals = rng.integers(20, 230, (40, 8, 4, 4, 3))
    copies = np.repeat(originals, rng.integers(1, 4, 40), axis=0)
    noisy = copies + rng.integers(-1, 2, copies.shape)
    sources = [int(np.abs(originals - one).reshape(40, -1).max(1).argmin()) for one in noisy]
    expected = [[i for i, s in enumerate(sources) if s == source] for source in range(40)]
    assert near_duplicates(noisy.astype(np.uint8)) == [group for group in expected if len(group) > 1]


def test_few_videos_are_no_trouble() -> None:
    assert near_duplicates(np.zeros((0, 8, 4, 4, 3), np.uint8)) == []
    assert near_duplicates(np.zeros((1, 8, 4, 4, 3), np.uint8)) == []
    assert near_duplicates(np.zeros((3, 8, 4, 4, 3), np.uint8)) == [[0, 1, 2]]
