"""The networks of DrQ-v2 (Yarats et al., 2021): encoder, actor, twin critic, and how they start."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from bootifol.agents.config import EncoderName
from bootifol.networks.eyes import as_features
from bootifol.types import Observation

_CONVOLUTIONS: dict[EncoderName, tuple[tuple[int, int, int], ...]] = {
    "paper": ((32, 3, 2), (32, 3, 1), (32, 3, 1), (32, 3, 1)),
    "strided": ((32, 3, 2), (32, 3, 2), (32, 3, 1), (32, 3, 1)),
    "coarse": ((32, 8, 4), (64, 4, 2), (64, 3, 1)),
}
"""Output channels, kernel size and stride of each convolution; none pads, a ReLU follows each."""


class Encoder(nn.Module):
    """Convolutions over a stack of frames, on pixels scaled to [-0.5, 0.5].

    The scaling is folded into the first convolution: nothing is padded, so `W * (x / 255 - 0.5) + b` is
    `(W / 255) * x + (b - sum(W) / 2)`, and pixels 0 ... 255 are exact in bfloat16. That saves two passes
    over the largest array of an update.

    Args:
        name: which stack of convolutions.
        channels: `3 * stack`.
        frame_size: `S`, in pixels.
    """

    def __init__(self, name: EncoderName, channels: int, frame_size: int) -> None:
        super().__init__()
        size = frame_size
        convolutions = []
        for width, kernel, stride in _CONVOLUTIONS[name]:
            convolutions.append(nn.Conv2d(channels, width, kernel, stride))
            channels, size = width, max((size - kernel) // stride + 1, 0)
        self.first, *rest = convolutions
        self.rest = nn.ModuleList(rest)
        self.feature_count = channels * size**2

    def forward(self, observation: Tensor) -> Tensor:
        """Features `[B, feature_count]` of observations `[B, 3 * stack, S, S]`, floating point in [0, 255].

        Flattened rows first, channels last: the order they have in channels-last memory, so nothing is moved.
        """
        weight, bias = self.first.weight, self.first.bias
        assert bias is not None
        shifted_bias = bias - 0.5 * weight.sum(dim=(1, 2, 3))
        features = nn.functional.conv2d(observation, weight / 255, shifted_bias, self.first.stride).relu_()
        for convolution in self.rest:
            features = convolution(features).relu_()
        return features.permute(0, 2, 3, 1).flatten(1)


class EncodingEncoder(nn.Sequential):
    """The MLP of the paper's encoding-based agent, shared by actor and critics in place of the convolutions.

    The first layer is normalized: encodings have no fixed scale, and theirs moves while the reward learns.

    Args:
        inputs: numbers in a stack of encodings.
        hidden_dim: width of both layers, and number of features.
    """

    def __init__(self, inputs: int, hidden_dim: int) -> None:
        super().__init__(
            nn.Linear(inputs, hidden_dim),
            nn.LayerNorm(hidden_dim),
            nn.ReLU(),
            nn.Linear(hidden_dim, hidden_dim),
            nn.ReLU(),
        )
        self.feature_count = hidden_dim


class StateEncoder(nn.Module):
    """States of frames as they are: the eyes that made them rest, and the trunks learn from them.

    Args:
        inputs: numbers in a stack of states.
    """

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.feature_count = inputs

    def forward(self, states: Tensor) -> Tensor:
        """Features float32 `[B, inputs]` of states int8 `[B, inputs]`."""
        return as_features(states)


class Trunk(nn.Sequential):
    """Features `[B, feature_count]` squeezed to `[B, feature_dim]` in (-1, 1)."""

    def __init__(self, feature_count: int, feature_dim: int) -> None:
        super().__init__(nn.Linear(feature_count, feature_dim), nn.LayerNorm(feature_dim), nn.Tanh())


class Head(nn.Module):
    """Two hidden layers; the output is computed in float32 whatever the precision before it.

    A bfloat16 output could not tell a Q of 100.0 from one of 100.4.
    """

    def __init__(self, inputs: int, hidden_dim: int, outputs: int, normalized: bool = False) -> None:
        super().__init__()
        self.hidden = nn.Sequential()
        for width in (inputs, hidden_dim):
            self.hidden.append(nn.Linear(width, hidden_dim))
            if normalized:
                self.hidden.append(nn.LayerNorm(hidden_dim))
            self.hidden.append(nn.ReLU(inplace=True))
        self.output = nn.Linear(hidden_dim, outputs)

    def forward(self, inputs: Tensor) -> Tensor:
        hidden = self.hidden(inputs)
        with torch.autocast(hidden.device.type, enabled=False):
            output: Tensor = self.output(hidden.float())
        return output


class Actor(nn.Module):
    """Features to the mean action `[B, A]` in [-1, 1]."""

    def __init__(self, feature_count: int, action_dim: int, feature_dim: int, hidden_dim: int) -> None:
        super().__init__()
        self.trunk = Trunk(feature_count, feature_dim)
        self.policy = Head(feature_dim, hidden_dim, action_dim)

    def forward(self, features: Tensor) -> Tensor:
        return torch.tanh(self.before_tanh(features))

    def before_tanh(self, features: Tensor) -> Tensor:
        """Mean action before it is squashed, `[B, A]`."""
        output: Tensor = self.policy(self.trunk(features))
        return output


class Critic(nn.Module):
    """Two independent estimates of Q, each `[B]`, on one trunk."""

    def __init__(
        self, feature_count: int, action_dim: int, feature_dim: int, hidden_dim: int, normalized: bool = False
    ) -> None:
        super().__init__()
        self.trunk = Trunk(feature_count, feature_dim)
        self.q1 = Head(feature_dim + action_dim, hidden_dim, 1, normalized)
        self.q2 = Head(feature_dim + action_dim, hidden_dim, 1, normalized)

    def forward(self, features: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        return self.value(self.trunk(features), action)

    def value(self, trunk: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        """Q of actions `[B, A]` given the trunk's output `[B, feature_dim]`."""
        inputs = torch.cat([trunk, action.to(trunk.dtype)], dim=1)
        return self.q1(inputs).squeeze(1), self.q2(inputs).squeeze(1)


def as_batch(observation: Observation) -> Tensor:
    """An observation uint8 `[S, S, 3 * stack]` as a batch of one, `[1, 3 * stack, S, S]`, sharing its memory."""
    return torch.from_numpy(observation).permute(2, 0, 1).unsqueeze(0)


def initialize(network: nn.Module, generator: torch.Generator) -> None:
    """Orthogonal weights, zero biases; gain sqrt(2) for convolutions (a ReLU follows), 1 for linear layers."""
    for module in network.modules():
        if isinstance(module, nn.Conv2d | nn.Linear):
            gain = nn.init.calculate_gain("relu") if isinstance(module, nn.Conv2d) else 1.0
            nn.init.orthogonal_(module.weight, gain, generator=generator)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
        elif isinstance(module, nn.LayerNorm):
            module.reset_parameters()
