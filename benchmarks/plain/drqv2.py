"""DrQ-v2 written plainly from its paper (Yarats et al., 2021): fp32, contiguous memory, one thing after another.

It is what `bootifol.agents` and `bootifol.replay` are measured against, and what their tests compare with.
Nothing here is meant to be fast, and nothing is shared with the fast version except the types.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from bootifol.types import Batch, Episode, Rewards

PAPER_CONVOLUTIONS = ((32, 3, 2), (32, 3, 1), (32, 3, 1), (32, 3, 1))
"""Output channels, kernel size, stride."""


class PlainReplay:
    """Whole episodes in a list; a batch is built transition by transition with numpy's fancy indexing."""

    def __init__(self, stack: int = 3, n_step: int = 3, discount: float = 0.99) -> None:
        self.stack = stack
        self.n_step = n_step
        self.discount = discount
        self.episodes: list[tuple[Episode, Rewards]] = []

    def add(self, episode: Episode, rewards: Rewards) -> None:
        self.episodes.append((episode, rewards))

    def observation(self, episode: Episode, t: int) -> NDArray[np.uint8]:
        """The stack that ends at frame `t`, uint8 `[3 * stack, S, S]`; frame 0 repeats before the start."""
        indices = [max(t - age, 0) for age in reversed(range(self.stack))]
        stacked = episode.frames[indices].transpose(0, 3, 1, 2)
        return stacked.reshape(-1, *stacked.shape[2:])

    def transition(
        self, index: int, t: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], float, float, NDArray[np.uint8]]:
        """Observation, action, n-step reward, discount of the next value, next observation."""
        episode, rewards = self.episodes[index]
        reward, discount, step = 0.0, 1.0, t
        while step < min(t + self.n_step, episode.agent_steps):
            reward += discount * float(rewards[step])
            discount *= self.discount
            step += 1
        if episode.terminated and step == episode.agent_steps:
            discount = 0.0
        return (
            self.observation(episode, t),
            episode.actions[t],
            reward,
            discount,
            self.observation(episode, step),
        )

    def batch(self, chosen: Sequence[tuple[int, int]]) -> Batch:
        """The transitions `(episode index, t)`, not augmented."""
        observation, action, reward, discount, next_observation = zip(
            *(self.transition(index, t) for index, t in chosen), strict=True
        )
        return Batch(
            observation=torch.from_numpy(np.stack(observation)),
            action=torch.from_numpy(np.stack(action)),
            reward=torch.tensor(reward, dtype=torch.float32),
            discount=torch.tensor(discount, dtype=torch.float32),
            next_observation=torch.from_numpy(np.stack(next_observation)),
        )

    def sample(self, batch_size: int, rng: np.random.Generator) -> Batch:
        lengths = np.array([episode.agent_steps for episode, _ in self.episodes])
        index = rng.choice(len(lengths), size=batch_size, p=lengths / lengths.sum())
        return self.batch([(int(i), int(rng.integers(lengths[i]))) for i in index])


def random_shift(pictures: Tensor, shifts: Tensor, pad: int) -> Tensor:
    """DrQ's augmentation by bilinear sampling on a shifted grid.

    Args:
        pictures: float `[B, C, S, S]`.
        shifts: `[B, 2]`, whole pixels `(dy, dx)` in [-pad, pad].
        pad: pixels of replicated border.

    Returns:
        `[B, C, S, S]`; pixel `(y, x)` is that of `(y + dy, x + dx)`.
    """
    count, _, size, _ = pictures.shape
    padded = functional.pad(pictures, (pad,) * 4, mode="replicate")
    padded_size = size + 2 * pad
    pixels = torch.arange(size, dtype=torch.float32) + pad
    rows = pixels[None, :] + shifts[:, :1].float()
    columns = pixels[None, :] + shifts[:, 1:].float()
    # grid_sample counts from -1 at the left edge of the first pixel to 1 at the right edge of the last.
    grid_y = ((2 * rows + 1) / padded_size - 1)[:, :, None].expand(count, size, size)
    grid_x = ((2 * columns + 1) / padded_size - 1)[:, None, :].expand(count, size, size)
    return functional.grid_sample(padded, torch.stack([grid_x, grid_y], dim=-1), align_corners=False)


class PlainEncoder(nn.Module):
    def __init__(
        self, channels: int, size: int, convolutions: Sequence[tuple[int, int, int]] = PAPER_CONVOLUTIONS
    ) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for width, kernel, stride in convolutions:
            layers += [nn.Conv2d(channels, width, kernel, stride), nn.ReLU()]
            channels, size = width, (size - kernel) // stride + 1
        self.layers = nn.Sequential(*layers)
        self.last = (channels, size, size)

    def forward(self, pixels: Tensor) -> Tensor:
        features: Tensor = self.layers(pixels / 255 - 0.5)
        return features.flatten(1)


def _trunk(feature_count: int, feature_dim: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(feature_count, feature_dim), nn.LayerNorm(feature_dim), nn.Tanh())


def _head(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, hidden),
        nn.ReLU(),
        nn.Linear(hidden, hidden),
        nn.ReLU(),
        nn.Linear(hidden, outputs),
    )


class PlainActor(nn.Module):
    def __init__(self, feature_count: int, action_dim: int, feature_dim: int, hidden: int) -> None:
        super().__init__()
        self.trunk = _trunk(feature_count, feature_dim)
        self.policy = _head(feature_dim, hidden, action_dim)

    def forward(self, features: Tensor) -> Tensor:
        return torch.tanh(self.policy(self.trunk(features)))


class PlainCritic(nn.Module):
    def __init__(self, feature_count: int, action_dim: int, feature_dim: int, hidden: int) -> None:
        super().__init__()
        self.trunk = _trunk(feature_count, feature_dim)
        self.q1 = _head(feature_dim + action_dim, hidden, 1)
        self.q2 = _head(feature_dim + action_dim, hidden, 1)

    def forward(self, features: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        joined = torch.cat([self.trunk(features), action], dim=1)
        return self.q1(joined), self.q2(joined)


class PlainDrQv2:
    """One update after the other as the paper's Section 3.1 lists them.

    The noise and the shifts are arguments so that a test can give the same to both versions.
    """

    def __init__(
        self,
        frame_size: int,
        stack: int,
        action_dim: int,
        feature_dim: int = 50,
        hidden: int = 1024,
        convolutions: Sequence[tuple[int, int, int]] = PAPER_CONVOLUTIONS,
        learning_rate: float = 1e-4,
        tau: float = 0.01,
        noise_clip: float = 0.3,
    ) -> None:
        self.encoder = PlainEncoder(3 * stack, frame_size, convolutions)
        channels, height, width = self.encoder.last
        sizes = (channels * height * width, action_dim, feature_dim, hidden)
        self.actor = PlainActor(*sizes)
        self.critic = PlainCritic(*sizes)
        self.target_critic = copy.deepcopy(self.critic)
        self.tau = tau
        self.noise_clip = noise_clip
        self.encoder_optimizer = torch.optim.Adam(self.encoder.parameters(), learning_rate)
        self.actor_optimizer = torch.optim.Adam(self.actor.parameters(), learning_rate)
        self.critic_optimizer = torch.optim.Adam(self.critic.parameters(), learning_rate)

    def noisy(self, mean: Tensor, noise: Tensor) -> Tensor:
        """The truncated normal: clipped noise, action cut to [-1, 1], gradient straight through to the mean."""
        action = mean + noise.clamp(-self.noise_clip, self.noise_clip)
        return action - action.detach() + action.detach().clamp(-1, 1)

    def update(
        self, batch: Batch, next_noise: Tensor, noise: Tensor, shifts: Tensor | None = None, pad: int = 4
    ) -> dict[str, float]:
        """Args: the noise is `[B, A]`, already scaled; `shifts` is `[2, B, 2]`, or None if the batch is shifted."""
        observation, next_observation = batch.observation.float(), batch.next_observation.float()
        if shifts is not None:
            observation = random_shift(observation, shifts[0], pad)
            next_observation = random_shift(next_observation, shifts[1], pad)

        features = self.encoder(observation)
        with torch.no_grad():
            next_features = self.encoder(next_observation)
            next_action = self.noisy(self.actor(next_features), next_noise)
            next_q1, next_q2 = self.target_critic(next_features, next_action)
            target = batch.reward[:, None] + batch.discount[:, None] * torch.minimum(next_q1, next_q2)
        q1, q2 = self.critic(features, batch.action)
        critic_loss = functional.mse_loss(q1, target) + functional.mse_loss(q2, target)
        self.encoder_optimizer.zero_grad()
        self.critic_optimizer.zero_grad()
        torch.autograd.backward(critic_loss)
        self.critic_optimizer.step()
        self.encoder_optimizer.step()

        features = features.detach()
        action = self.noisy(self.actor(features), noise)
        actor_q1, actor_q2 = self.critic(features, action)
        actor_loss = -torch.minimum(actor_q1, actor_q2).mean()
        self.actor_optimizer.zero_grad()
        torch.autograd.backward(actor_loss)
        self.actor_optimizer.step()

        with torch.no_grad():
            for slow, fast in zip(self.target_critic.parameters(), self.critic.parameters(), strict=True):
                slow.copy_(self.tau * fast + (1 - self.tau) * slow)
        return {"critic_loss": critic_loss.item(), "actor_loss": actor_loss.item()}
