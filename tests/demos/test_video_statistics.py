import numpy as np

from bootifol.demos.video_statistics import statistics_of

FRAMES = 20


def walking_block(frames: int = FRAMES, moves: range = range(1, FRAMES)) -> np.ndarray:
    """A bright block over a colored slope; it takes a step before each frame of `moves`."""
    slope = np.linspace(40, 160, 32)[:, None, None] * np.array([1.0, 0.6, 0.4])
    video = np.broadcast_to(slope, (frames, 32, 32, 3)).astype(np.uint8)
    video = video.copy()
    for t in range(frames):
        left = sum(1 for step in moves if step <= t)
        video[t, 12:18, left : left + 6] = 250
    return video


def test_an_honest_video_has_nothing_to_report() -> None:
    looks = statistics_of(walking_block())
    assert (looks.blank, looks.cut) == (0, None)
    assert looks.still_before_motion == looks.still_at_end == 1 / FRAMES
    assert looks.first.base is None  # a view would keep the whole video alive


def test_stillness_before_and_after_the_motion_is_measured() -> None:
    looks = statistics_of(walking_block(moves=range(8, 14)))
    assert looks.still_before_motion == 8 / FRAMES
    assert looks.still_at_end == 7 / FRAMES


def test_noise_of_compression_is_no_motion() -> None:
    noise = np.random.default_rng(0).integers(0, 3, (FRAMES, 32, 32, 3), np.uint8)
    assert statistics_of(walking_block(moves=range(0)) + noise).still_at_end == 1.0


def test_a_slow_motion_is_no_stillness() -> None:
    video = walking_block(moves=range(0))
    video[:, 20:] += np.arange(FRAMES, dtype=np.uint8)[:, None, None, None]  # one level a frame
    assert statistics_of(video).still_at_end < 0.2


def test_the_pixels_that_change_in_a_step_are_counted_while_something_moves() -> None:
    two_columns_of_the_block = 2 * 6 / 32**2
    assert statistics_of(walking_block()).moving_pixels == two_columns_of_the_block
    assert statistics_of(walking_block(moves=range(8, 14))).moving_pixels == two_columns_of_the_block
    assert statistics_of(walking_block(moves=range(0))).moving_pixels == 0.0
    assert statistics_of(walking_block()[:1]).moving_pixels == 0.0


def test_blank_pictures_are_counted_and_are_no_cut() -> None:
    video = walking_block()
    video[0], video[1], video[-1] = 0, 255, (0, 0, 200)
    looks = statistics_of(video)
    assert (looks.blank, looks.cut) == (3, None)


def test_a_cut_is_found_where_it_is() -> None:
    video = walking_block()
    video[12:] = 255 - video[12:]
    assert statistics_of(video).cut == 12


def test_a_camera_on_the_move_is_no_cut() -> None:
    stripes = (np.arange(32) // 4 % 2 * 200).astype(np.uint8)
    video = np.stack(
        [np.broadcast_to(np.roll(stripes, 3 * t)[None, :, None], (32, 32, 3)) for t in range(FRAMES)]
    )
    assert statistics_of(video).cut is None


def test_tiny_and_single_pictures_are_looked_at() -> None:
    assert statistics_of(np.zeros((1, 3, 5, 3), np.uint8)).still_at_end == 1.0
