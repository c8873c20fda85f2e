"""What the encoding-based agent sees: the reward model's encodings of its frames (paper, "Ablating the use of a
Learned Image-Encoder for RL").

Replay keeps pictures, and they are encoded whenever a batch is drawn: the encoder learns on while the agent acts, and
encodings that were stored would be those of an older one.
"""

from __future__ import annotations

import numpy as np
from torch import Tensor

from bootifol.envs.pictures import resize
from bootifol.rewards.base import EncodesFrames
from bootifol.types import Frames

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
