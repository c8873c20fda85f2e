"""Inverse dynamics: which action leads from one picture to the next, learned from the agent's own steps.

Applied to the expert's videos it gives the actions that they do not show. This goes beyond the paper; the idea is
that of "Behavioral Cloning from Observation" (Torabi, Warnell, Stone, 2018), on pictures.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from bootifol.agents.config import EncoderName
from bootifol.agents.networks import Encoder, StateEncoder
from bootifol.devices import to_device, to_host
from bootifol.optim import load_module_state, module_state, take_step
from bootifol.settings import Precision
from bootifol.types import Arrays, Batch, Frames, FrameStates, StepMetrics


class InverseDynamics:
    """Predicts action `a_t` from the stacks of pictures that end at frame `t` and at frame `t + n`.

    Args:
        encoder: convolutions over both stacks.
        frame_size: height and width of the pictures in pixels.
        stack: pictures of a stack.
        n_step: how far apart the two stacks are; at the end of an episode they are closer, in training and in use.
        action_dim: action dimensions.
        seed: of the initial parameters.
        hidden_dim: width of the two hidden layers.
        precision: of convolutions and matrix products; parameters and the loss are float32.
        device: where to compute, as PyTorch names it.
        state_size: Z, where it reads states of frames instead of pictures, and `encoder` and `frame_size` say nothing.
    """

    def __init__(
        self,
        encoder: EncoderName,
        frame_size: int,
        stack: int,
        n_step: int,
        action_dim: int,
        seed: int,
        hidden_dim: int = 512,
        precision: Precision = "bf16",
        device: str = "cpu",
        state_size: int = 0,
    ) -> None:
        self.stack, self.n_step = stack, n_step
        self._dtype = torch.bfloat16 if precision == "bf16" else torch.float32
        self._device = torch.device(device)
        # PyTorch initializes layers from its global generator, so it is seeded here and given back as it was.
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            see: Encoder | StateEncoder = (
                StateEncoder(2 * stack * state_size)
                if state_size
                else Encoder(encoder, 6 * stack, frame_size)
            )
            self.network = nn.Sequential(
                see,
                nn.Linear(see.feature_count, hidden_dim),
                nn.LayerNorm(hidden_dim),
                nn.ReLU(),
                nn.Linear(hidden_dim, hidden_dim),
                nn.ReLU(),
                nn.Linear(hidden_dim, action_dim),
            )
        see.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.network.to(self._device)
        self._optimizer = torch.optim.Adam(self.network.parameters(), fused=True)

    def update(self, batch: Batch, learning_rate: float) -> StepMetrics:
        """One gradient step on the agent's own transitions, whose two observations were shifted alike.

        Args:
            batch: the transitions.
            learning_rate: of Adam, for this step.

        Returns:
            The mean squared error of the actions.

        Raises:
            BootifolError: it is NaN or infinite (see `take_step`); the parameters are as before.
        """
        predicted = self._predict(batch.observation, batch.next_observation)
        loss = nn.functional.mse_loss(predicted, to_device(batch.action, self._device))
        self._optimizer.param_groups[0]["lr"] = learning_rate
        advice = "the step was not taken: lower demonstrations.inverse_dynamics_learning_rate in the run's config.json"
        take_step(self._optimizer, loss, "the inverse dynamics", advice)
        return {"inverse_dynamics/loss": loss.detach()}

    def actions(self, frames: Frames | FrameStates) -> NDArray[np.float32]:
        """The actions `[T, A]` in [-1, 1] that a video `[T + 1, S, S, 3]`, or its states `[T + 1, Z]`, shows."""
        steps = len(frames) - 1
        now = np.arange(steps)[:, None]
        back = np.arange(1 - self.stack, 1)
        before = frames[np.maximum(now + back, 0)]
        after = frames[np.maximum(np.minimum(now + self.n_step, steps) + back, 0)]
        with torch.inference_mode():
            predicted = self._predict(_stacked(before), _stacked(after)).clamp(-1.0, 1.0)
        actions: NDArray[np.float32] = to_host(predicted)
        return actions

    def state(self) -> Arrays:
        """Parameters and optimizer."""
        return module_state(self.network, {"adam": self._optimizer})

    def load_state(self, arrays: Arrays) -> None:
        """Restores what `state` returned, bit for bit.

        Raises:
            BootifolError: the arrays belong to networks of other sizes.
        """
        load_module_state(self.network, {"adam": self._optimizer}, arrays, "inverse dynamics")

    def _predict(self, before: Tensor, after: Tensor) -> Tensor:
        """Actions `[B, A]` from two stacks, uint8 `[B, 3 * stack, S, S]` or int8 `[B, stack * Z]` each."""
        pictures = torch.cat([to_device(stack, self._device) for stack in (before, after)], dim=1)
        if pictures.dtype == torch.uint8:
            pictures = pictures.to(self._dtype, memory_format=torch.channels_last)
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._dtype == torch.bfloat16):
            output: Tensor = self.network(pictures)
        return output.float()


def _stacked(frames: NDArray[np.uint8] | NDArray[np.int8]) -> Tensor:
    """`[T, stack, S, S, 3]` to uint8 `[T, 3 * stack, S, S]`, the oldest frame's channels first; or `[T, stack, Z]` to
    int8 `[T, stack * Z]`."""
    if frames.ndim == 3:
        return torch.from_numpy(frames.reshape(len(frames), -1))
    steps, stack, height, width, _ = frames.shape
    moved = frames.transpose(0, 1, 4, 2, 3).reshape(steps, 3 * stack, height, width)
    return torch.from_numpy(np.ascontiguousarray(moved))
