"""The encoding-based agent: what it sees, and that nothing of it teaches the encoder."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.encodings import FrameEncodings
from bootifol.errors import BootifolError
from bootifol.rewards.base import EncodesFrames
from bootifol.types import Batch, Frames

SIZE, STACK = 8, 2
CONFIG = DrQv2Config(observations="encodings", hidden_dim=16, feature_dim=8, precision="fp32")


class MeanColor:
    """Encodes a frame as the means of its three channels, times a factor that may be learned."""

    encoding_dim = 3

    def __init__(self, video_size: int = SIZE) -> None:
        self.video_size = video_size
        self.factor = 1.0
        self.shapes: list[tuple[int, ...]] = []

    def encode_frames(self, frames: Frames) -> torch.Tensor:
        self.shapes.append(frames.shape)
        return torch.from_numpy(self.factor * frames.mean(axis=(1, 2), dtype=np.float32))


def stacked(*colors: tuple[int, int, int]) -> torch.Tensor:
    """One observation uint8 `[1, 3 * stack, S, S]` of frames of one color each, oldest first."""
    channels = torch.tensor([value for color in colors for value in color], dtype=torch.uint8)
    return channels[None, :, None, None].expand(1, -1, SIZE, SIZE).contiguous()


def make_batch(count: int = 4) -> Batch:
    def pictures() -> torch.Tensor:
        return torch.randint(0, 256, (count, 3 * STACK, SIZE, SIZE), dtype=torch.uint8)

    reward, discount = torch.ones(count), torch.full((count,), 0.9)
    return Batch(pictures(), torch.rand(count, 2), reward, discount, pictures())


def make_agent(model: MeanColor) -> DrQv2:
    return DrQv2(CONFIG, SIZE, STACK, 2, seed=0, encodings=FrameEncodings(model, STACK))


def test_frames_are_encoded_one_by_one_oldest_first() -> None:
    encodings = FrameEncodings(MeanColor(), STACK)
    assert encodings.size == 6
    assert encodings(stacked((1, 2, 3), (40, 50, 60))).tolist() == [[1, 2, 3, 40, 50, 60]]


def test_larger_pictures_are_encoded_at_the_reward_models_size() -> None:
    model = MeanColor(video_size=4)
    FrameEncodings(model, STACK)(make_batch(3).observation)
    assert model.shapes == [(3 * STACK, 4, 4, 3)]


def test_what_encodes_frames_is_recognized() -> None:
    assert isinstance(MeanColor(), EncodesFrames)


def test_the_agent_sees_the_newest_encoder() -> None:
    model = MeanColor()
    agent, observation = make_agent(model), np.full((SIZE, SIZE, 3 * STACK), 100, np.uint8)
    observation[:4] = 7
    observation[..., 0] = 200
    before = agent.act(observation, 0, explore=False)
    np.testing.assert_array_equal(agent.act(observation, 0, explore=False), before)
    model.factor = -1.0
    assert not np.array_equal(agent.act(observation, 0, explore=False), before)


def test_updates_and_clones_train_the_mlp() -> None:
    agent, batch = make_agent(MeanColor()), make_batch()
    for learn in (lambda: agent.update(batch, 0), lambda: agent.clone(batch, 1e-3)):
        before = {name: value for name, value in agent.state().items() if name.startswith("encoder.")}
        learn()
        changed = [name for name, value in before.items() if not np.array_equal(value, agent.state()[name])]
        assert changed == list(before)


def test_without_a_model_there_is_nothing_to_see() -> None:
    with pytest.raises(BootifolError, match=r"agent\.observations encodings needs a reward model"):
        DrQv2(CONFIG, SIZE, STACK, 2, seed=0)
    with pytest.raises(
        BootifolError, match=r"agent\.observations must be pictures, encodings or states, not"
    ):
        dataclasses.replace(CONFIG, observations="words")
