"""DrQ-v2: a deterministic actor and twin critics on pixels.

Yarats, Fergus, Lazaric, Pinto: "Mastering Visual Continuous Control: Improved Data-Augmented
Reinforcement Learning" (2021). Section 3.1 gives the update: the random shift (which replay has already
applied), n-step clipped double Q-learning, a critic loss that trains the encoder, an actor loss that does
not, and exploration noise on a linear schedule, which also smooths the targets.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from bootifol.agents.config import DrQv2Config
from bootifol.agents.encodings import FrameEncodings, StackedStates
from bootifol.agents.networks import (
    Actor,
    Critic,
    Encoder,
    EncodingEncoder,
    StateEncoder,
    as_batch,
    initialize,
)
from bootifol.devices import to_device, to_host
from bootifol.errors import BootifolError
from bootifol.networks.eyes import Eyes
from bootifol.optim import load_module_state, module_state, take_step
from bootifol.types import Action, Arrays, Batch, Observation, StepMetrics

AnyEncoder = Encoder | EncodingEncoder | StateEncoder

SATURATED = 0.98
"""Mean actions beyond this are counted as saturated in the metrics."""


def critic_target(reward: Tensor, discount: Tensor, next_q1: Tensor, next_q2: Tensor) -> Tensor:
    """Clipped double Q-learning: `reward + discount * min(next_q1, next_q2)`, all `[B]`."""
    return reward + discount * torch.minimum(next_q1, next_q2)


def critic_loss(q1: Tensor, q2: Tensor, target: Tensor) -> Tensor:
    """Mean squared errors of both critics, summed (DrQ-v2, equation 1)."""
    return nn.functional.mse_loss(q1, target) + nn.functional.mse_loss(q2, target)


def actor_loss(q1: Tensor, q2: Tensor) -> Tensor:
    """Minus the mean of the smaller estimate (DrQ-v2, equation 2)."""
    return -torch.minimum(q1, q2).mean()


def saturation_loss(before_tanh: Tensor) -> Tensor:
    """Mean square of the actor's outputs `[B, A]` before tanh (as MR.Q has it: Fujimoto et al., 2025)."""
    return before_tanh.square().mean()


def cloning_loss(action: Tensor, demonstrated_action: Tensor) -> Tensor:
    """Mean squared error of the actor's actions `[B, A]` to demonstrated ones `[B, A]`. Not in DrQ-v2."""
    return nn.functional.mse_loss(action, demonstrated_action)


def noisy_action(mean: Tensor, stddev: float, clip: float | None, generator: torch.Generator) -> Tensor:
    """The mean action plus normal noise, cut to [-1, 1].

    Args:
        mean: `[B, A]` in [-1, 1].
        stddev: of the noise.
        clip: largest noise, or None for no limit.
        generator: where the noise comes from; the CPU's, so that every device gets the same.

    Returns:
        `[B, A]`. The cut to [-1, 1] is ignored by the gradient: it is that of `mean`, even at the border.
    """
    noise = to_device(torch.randn(mean.shape, generator=generator), mean.device) * stddev
    if clip is not None:
        noise = noise.clamp_(-clip, clip)
    with torch.no_grad():
        offset = (mean + noise).clamp_(-1.0, 1.0) - mean
    return mean + offset


@dataclass(frozen=True)
class Pull:
    """What keeps the policy near demonstrated actions while it learns from rewards. Not in DrQ-v2."""

    rows: Tensor
    """Which of a batch are demonstrated, int64 `[D]`."""
    action: Tensor
    """What was done there, `[D, A]`."""
    weight: Tensor
    """Of the cloning loss, a scalar."""


class DrQv2:
    """The agent.

    Args:
        config: hyperparameters.
        frame_size: height and width of the observations in pixels.
        stack: frames stacked in an observation.
        action_dim: action dimensions.
        seed: of the initial parameters and of the noise.
        device: where to compute, as PyTorch names it.
        encodings: what turns pictures into encodings where the configuration says so; None otherwise.

    Raises:
        BootifolError: the frames are too small for the encoder, or there are no encodings to act on.
    """

    def __init__(
        self,
        config: DrQv2Config,
        frame_size: int,
        stack: int,
        action_dim: int,
        seed: int,
        device: str = "cpu",
        encodings: FrameEncodings | StackedStates | None = None,
    ) -> None:
        self.config = config
        self._device = torch.device(device)
        self._encodings = None if config.observations == "pictures" else encodings
        with torch.device("meta"):  # torch's own initialization would draw from the global generator
            self.encoder = self._make_encoder(3 * stack, frame_size)
            sizes = (self.encoder.feature_count, action_dim, config.feature_dim, config.hidden_dim)
            self.actor = Actor(*sizes)
            self.critic = Critic(*sizes, config.critic_norm)
            self.target_critic = Critic(*sizes, config.critic_norm)
        start = torch.Generator().manual_seed(seed)
        for network in (self.encoder, self.actor, self.critic, self.target_critic):
            network.to_empty(device="cpu")
            initialize(network, start)
            network.to(self._device)
        _to_channels_last(self.encoder)
        self.target_critic.load_state_dict(self.critic.state_dict())
        self.target_critic.requires_grad_(False)
        self._averages = 0
        self._averaged: tuple[AnyEncoder, Actor] | None = None
        if config.ema_decay > 0:
            self._averaged = copy.deepcopy(self.encoder), copy.deepcopy(self.actor)
        self._generator = torch.Generator().manual_seed(int(start.initial_seed()) + 1)
        self._critic_optimizer = torch.optim.Adam(
            [*self.encoder.parameters(), *self.critic.parameters()], config.learning_rate, fused=True
        )
        self._actor_optimizer = torch.optim.Adam(self.actor.parameters(), config.learning_rate, fused=True)
        self._cloning_optimizer = torch.optim.Adam(
            [*self.encoder.parameters(), *self.actor.parameters()], config.learning_rate, fused=True
        )

    def _make_encoder(self, channels: int, frame_size: int) -> AnyEncoder:
        if isinstance(self._encodings, StackedStates):
            return StateEncoder(self._encodings.size)
        if self._encodings is not None:
            return EncodingEncoder(self._encodings.size, self.config.hidden_dim)
        if self.config.observations != "pictures":
            raise BootifolError(
                f"agent.observations {self.config.observations} needs a reward model whose {self.config.observations} "
                "the agent reads; without one use agent.observations pictures"
            )
        encoder = Encoder(self.config.encoder, channels, frame_size)
        if encoder.feature_count == 0:
            raise BootifolError(
                f"frames of {frame_size}x{frame_size} pixels are too small for the agent's "
                f"{self.config.encoder!r} encoder; make them larger or choose another encoder"
            )
        return encoder

    @property
    def eyes(self) -> Eyes | None:
        """What makes the states that the agent reads; None where it reads something else."""
        return self._encodings.eyes if isinstance(self._encodings, StackedStates) else None

    @property
    def acting(self) -> tuple[AnyEncoder, Actor]:
        """The networks that act without exploration: the averaged ones where there are any, else the newest."""
        return (self.encoder, self.actor) if self._averaged is None else self._averaged

    def act(self, observation: Observation, agent_steps: float, explore: bool) -> Action:
        """One action.

        Args:
            observation: uint8 `[S, S, 3 * stack]`.
            agent_steps: where the noise schedule stands.
            explore: True adds its noise; False returns the mean, with averaged parameters where there are any.

        Returns:
            float32 `[A]` in [-1, 1].
        """
        with torch.inference_mode():
            encoder, actor = (self.encoder, self.actor) if explore else self.acting
            mean = actor(encoder(self._network_input(as_batch(observation), torch.float32)))
            if explore:
                mean = noisy_action(mean, self.config.exploration(agent_steps), None, self._generator)
            action: Action = to_host(mean[0])  # which the environment waits for
            return action

    def clone(self, batch: Batch, learning_rate: float) -> StepMetrics:
        """One gradient step of encoder and actor towards the actions of a batch; its rewards are not looked at.

        Args:
            batch: observations and demonstrated actions.
            learning_rate: of Adam, for this step.

        Raises:
            BootifolError: the loss is NaN or infinite (see `take_step`); the parameters are as before.
        """
        observation = self._network_input(batch.observation, self._precision)
        with self._autocast():
            action = self.actor(self.encoder(observation))
        loss = cloning_loss(action, to_device(batch.action, self._device))
        self._cloning_optimizer.param_groups[0]["lr"] = learning_rate
        self._step(self._cloning_optimizer, loss, "cloning")
        self._average()
        return {"agent/cloning_loss": loss.detach()}

    def update(self, batch: Batch, agent_steps: float) -> StepMetrics:
        """One update of critic and encoder, of the actor, and of the target critic, in this order: Algorithm 1.

        Nothing in it waits for a GPU, and metrics stay there until they are logged.

        Raises:
            BootifolError: a loss is NaN or infinite (see `take_step`); the parameters are as before the step that
                failed.
        """
        # "Compute stddev for the exploration noise."
        stddev = self.config.exploration(agent_steps)
        # "Sample a mini batch of transitions" and "apply data augmentation": replay has done both.
        batch = self._on_device(batch)
        # UpdateCritic, of which the encoder learns too.
        features, pull, critic_metrics = self.update_critic(batch, stddev)
        # UpdateActor, of which it does not.
        actor_metrics = self.update_actor(features.detach(), stddev, pull)
        # "Update critic target weights."
        self.update_target()
        # Beyond DrQ-v2: averages act in evaluations.
        self._average()
        return {**critic_metrics, **actor_metrics, "agent/exploration": stddev}

    def update_critic(self, batch: Batch, stddev: float) -> tuple[Tensor, Pull | None, StepMetrics]:
        """One step of both critics and of the encoder (UpdateCritic).

        Args:
            batch: on the agent's device, observations as the encoder reads them.
            stddev: of the noise that smooths the target.

        Returns:
            Features of the observations, `[B, feature_count]`, as they were before the step; what pulls the policy
            to demonstrated actions, None where nothing does; metrics.
        """
        # "Sample action" of the later frame, and the target of equation 1.
        with torch.no_grad(), self._autocast():
            next_features = self.encoder(batch.next_observation)
            next_action = self._noisy(self.actor(next_features), stddev)
            next_q = self.target_critic(next_features, next_action)
            target = critic_target(batch.reward, batch.discount, *next_q)
        # "Compute the critic losses using equation 1."
        with self._autocast():
            features = self.encoder(batch.observation)
            q1, q2 = self.critic(features, batch.action)
        loss_of_critic = critic_loss(q1, q2, target)
        # Beyond DrQ-v2: the encoder learns to tell demonstrated actions as well.
        loss = loss_of_critic
        pull = self._pull(batch, q1.detach())
        if pull is not None:
            with self._autocast():
                cloned = self.actor(features[pull.rows])
            loss = loss_of_critic + pull.weight * cloning_loss(cloned, pull.action)
        # "Update encoder weights" and "update critic weights."
        self._step(self._critic_optimizer, loss, "critic")
        metrics = {
            "agent/critic_loss": loss_of_critic.detach(),
            "agent/q": q1.detach().mean(),
            "agent/target": target.mean(),
            "agent/batch_reward": batch.reward.mean(),
        }
        return features, pull, metrics

    def update_actor(self, features: Tensor, stddev: float, pull: Pull | None) -> StepMetrics:
        """One step of the actor (UpdateActor).

        Args:
            features: of the observations, `[B, feature_count]`, without a gradient.
            stddev: of the noise on the actions that the critic judges.
            pull: to demonstrated actions; None where there is none.
        """
        with torch.no_grad(), self._autocast():
            trunk = self.critic.trunk(features)
        with self._autocast():
            # "Sample action."
            before_tanh = self.actor.before_tanh(features)
            mean_action = torch.tanh(before_tanh)
            # "Compute the actor loss using equation 2."
            loss = actor_loss(*self.critic.value(trunk, self._noisy(mean_action, stddev)))
        metrics: dict[str, Tensor] = {}
        # Beyond DrQ-v2: actions that saturate, and those that leave what was demonstrated, cost something.
        if self.config.saturation_weight > 0:
            loss = loss + self.config.saturation_weight * saturation_loss(before_tanh)
        if pull is not None:
            loss_of_cloning = cloning_loss(mean_action[pull.rows], pull.action)
            loss = loss + pull.weight * loss_of_cloning
            metrics["agent/cloning_loss"] = loss_of_cloning.detach()
        # "Update actor's weights only."
        self._step(self._actor_optimizer, loss, "actor")
        metrics["agent/actor_loss"] = loss.detach()
        metrics["agent/saturated"] = (mean_action.detach().abs() > SATURATED).float().mean()
        return metrics

    def update_target(self) -> None:
        """Moves the target critic a fraction `tau` of the way to the critic."""
        with torch.no_grad():
            torch._foreach_lerp_(
                list(self.target_critic.parameters()), list(self.critic.parameters()), self.config.tau
            )

    def _pull(self, batch: Batch, q1: Tensor) -> Pull | None:
        """What of a batch pulls to demonstrated actions, given Q `[B]`; None where nothing does."""
        if self.config.cloning_weight == 0 or batch.demonstrated is None:
            return None
        # As numbers: how many rows a mask has, a GPU would have to tell the host first.
        rows = to_device(batch.demonstrated.nonzero().squeeze(1), self._device)
        # Times the mean of |Q|, so that one weight suits rewards of any scale (as TD3+BC: Fujimoto and Gu, 2021).
        # The critic starts near 0, and without a floor its first errors would undo the clone.
        weight = self.config.cloning_weight * q1.abs().mean().clamp(min=1.0)
        return Pull(rows, batch.action[rows], weight)

    def _average(self) -> None:
        if self._averaged is None:
            return
        self._averages += 1
        # The mean at first, so that nothing is left of the initial parameters.
        weight = max(1.0 - self.config.ema_decay, 1.0 / self._averages)
        with torch.no_grad():
            for average, newest in zip(self._averaged, (self.encoder, self.actor), strict=True):
                pairs = list(zip(average.parameters(), newest.parameters(), strict=True))
                if pairs:  # states have no encoder that learns
                    torch._foreach_lerp_([old for old, _ in pairs], [new for _, new in pairs], weight)

    def state(self) -> Arrays:
        """Copies of all parameters, of the optimizers and of the noise generator."""
        arrays = module_state(self._networks(), self._optimizers())
        arrays["generator"] = self._generator.get_state().numpy()
        if self._averaged is not None:
            arrays["averages"] = np.array([self._averages], np.int64)
        return arrays

    def load_state(self, arrays: Arrays) -> None:
        """Restores what `state` returned, bit for bit.

        Raises:
            BootifolError: the arrays belong to networks of other sizes.
        """
        load_module_state(self._networks(), self._optimizers(), arrays, "agent")
        self._generator.set_state(torch.from_numpy(arrays["generator"].copy()))
        if self._averaged is not None:
            self._averages = int(arrays["averages"][0])

    def _networks(self) -> nn.ModuleDict:
        networks: dict[str, nn.Module] = {
            "encoder": self.encoder,
            "actor": self.actor,
            "critic": self.critic,
            "target_critic": self.target_critic,
        }
        if self._averaged is not None:
            networks["averaged_encoder"], networks["averaged_actor"] = self._averaged
        return nn.ModuleDict(networks)

    def _optimizers(self) -> dict[str, torch.optim.Adam]:
        return {
            "critic_adam": self._critic_optimizer,
            "actor_adam": self._actor_optimizer,
            "cloning_adam": self._cloning_optimizer,
        }

    def _network_input(self, observation: Tensor, dtype: torch.dtype) -> Tensor:
        """What the encoder reads of pictures uint8 `[B, 3 * stack, S, S]`: they themselves, or their encodings; and of
        states int8 `[B, stack * Z]`, which stay whole numbers until then."""
        if self._encodings is not None and observation.dtype == torch.uint8:
            observation = self._encodings(observation)
        if observation.dtype == torch.int8:
            return to_device(observation, self._device)
        return to_device(observation, self._device).to(dtype)

    def _on_device(self, batch: Batch) -> Batch:
        """A batch where the agent computes, its observations as the encoder reads them; which rows are demonstrated
        stays with the host."""
        return replace(
            batch,
            observation=self._network_input(batch.observation, self._precision),
            next_observation=self._network_input(batch.next_observation, self._precision),
            action=to_device(batch.action, self._device),
            reward=to_device(batch.reward, self._device),
            discount=to_device(batch.discount, self._device),
        )

    @property
    def _precision(self) -> torch.dtype:
        return torch.bfloat16 if self.config.precision == "bf16" else torch.float32

    def _autocast(self) -> torch.autocast:
        return torch.autocast(self._device.type, torch.bfloat16, enabled=self.config.precision == "bf16")

    def _noisy(self, mean: Tensor, stddev: float) -> Tensor:
        return noisy_action(mean, stddev, self.config.noise_clip, self._generator)

    @staticmethod
    def _step(optimizer: torch.optim.Adam, loss: Tensor, what: str) -> None:
        advice = (
            "the rewards may have grown without bound: lower agent.learning_rate in the run's config.json"
        )
        take_step(optimizer, loss, f"the agent's {what}", advice)


def _to_channels_last(network: nn.Module) -> None:
    for parameter in network.parameters():
        if parameter.dim() == 4:
            parameter.data = parameter.data.to(memory_format=torch.channels_last)
