import numpy as np
import torch

from bootifol.rewards.gaifo.stacks import as_pictures, draw_stacks, stack_frames


def test_the_first_frame_stands_in_for_those_before_it() -> None:
    assert stack_frames(np.arange(1, 5), 3).tolist() == [[0, 0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 4]]


def test_stacks_are_drawn_at_every_moment_of_their_own_video() -> None:
    # The pixel's value says which video and which frame it is.
    videos = (10 * np.arange(3)[:, None] + np.arange(5)).astype(np.uint8)
    videos = np.broadcast_to(videos[:, :, None, None, None], (3, 5, 2, 2, 3))
    drawn = draw_stacks(videos, 200, 3, np.random.default_rng(0))
    assert drawn.shape == (600, 3, 2, 2, 3)
    values = drawn[:, :, 0, 0, 0].reshape(3, 200, 3).astype(int)
    for video in range(3):
        seen = {tuple(stack) for stack in values[video] - 10 * video}
        assert seen == {(0, 0, 1), (0, 1, 2), (1, 2, 3), (2, 3, 4)}


def test_pictures_hold_the_stack_oldest_first_as_channels() -> None:
    stacks = np.random.default_rng(0).integers(0, 256, (2, 3, 4, 5, 3), dtype=np.uint8)
    pictures = as_pictures(stacks)
    assert pictures.shape == (2, 9, 4, 5)
    assert pictures.is_contiguous(memory_format=torch.channels_last)
    assert pictures[1, 3 * 2 + 1, 3, 4].item() == np.float32(stacks[1, 2, 3, 4, 1]) / np.float32(255)
