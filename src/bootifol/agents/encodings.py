"""What the encoding-based agent sees: the reward model's encodings of its frames (paper, "Ablating the use of a
Learned Image-Encoder for RL").

Replay keeps pictures, and they are encoded whenever a batch is drawn: the encoder learns on while the agent acts, and
encodings that were stored would be those of an older one.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from bootifol.envs.pictures import resize
from bootifol.networks.eyes import Eyes
from bootifol.rewards.base import EncodesFrames
from bootifol.types import Frames, FrameStates

_CHANNELS = 3


class FrameEncodings:
    """Turns stacks of pictures into stacks of encodings.

    Args:
        model: encodes single frames; no gradient reaches it.
        stack: frames in an observation.
    """

    def __init__(self, model: EncodesFrames, stack: int) -> None:
        self._model = model
        self._stack = stack

    @property
    def size(self) -> int:
        """Numbers in a stack of encodings, `stack * Z`."""
        return self._stack * self._model.encoding_dim

    def __call__(self, observation: Tensor) -> Tensor:
        """Encodings float32 `[B, stack * Z]`, oldest first, of stacks of pictures uint8 `[B, 3 * stack, S, S]`.

        The pictures are the host's, which resizes them; the encodings are the reward model's device's.
        """
        count, _, height, width = observation.shape
        stacks = observation.reshape(count * self._stack, _CHANNELS, height, width)
        frames: Frames = stacks.permute(0, 2, 3, 1).numpy()
        if frames.shape[1] != self._model.video_size:
            frames = np.stack([resize(frame, self._model.video_size) for frame in frames])
        return self._model.encode_frames(frames).reshape(count, self.size)


class StackedStates:
    """Turns stacks of pictures into stacks of states, for acting; replay keeps states, and batches come with them.

    Frames are seen one by one, each once: the last bits of a convolution depend on how many frames it has, and a
    resumed run must see what the uninterrupted one did.

    Args:
        eyes: make states of frames, and rest.
        stack: frames in an observation.
    """

    def __init__(self, eyes: Eyes, stack: int) -> None:
        self.eyes = eyes
        self._stack = stack
        self._seen: dict[bytes, FrameStates] = {}

    @property
    def size(self) -> int:
        """Numbers in a stack of states, `stack * Z`."""
        return self._stack * self.eyes.feature_size

    def __call__(self, observation: Tensor) -> Tensor:
        """States int8 `[1, stack * Z]`, oldest first, of one stack of pictures uint8 `[1, 3 * stack, S, S]`."""
        size = observation.shape[-1]
        frames = observation.reshape(self._stack, _CHANNELS, size, size).permute(0, 2, 3, 1).numpy()
        seen: dict[bytes, FrameStates] = {}
        stacked = []
        for frame in frames:
            key = frame.tobytes()
            if key not in seen:
                known = self._seen.get(key)
                seen[key] = self.eyes.states(frame[None])[0] if known is None else known
            stacked.append(seen[key])
        self._seen = seen
        return torch.from_numpy(np.concatenate(stacked))[None]
