"""A trained policy by itself: pictures in, actions out, and the one file that holds it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.encodings import StackedStates
from bootifol.agents.networks import Actor, Encoder, as_batch
from bootifol.checksums import require_as_written
from bootifol.devices import to_host
from bootifol.envs.pictures import FrameStack, PictureConfig, centered_square, is_picture, resize, told_kind
from bootifol.envs.rollout import Act
from bootifol.errors import BootifolError
from bootifol.files import parsed_json, read_arrays, read_texts, write_arrays
from bootifol.networks.eyes import Eyes, as_features
from bootifol.plugins import told
from bootifol.types import Action, Arrays, Frame, Observation

FORMAT = 1


@dataclass(frozen=True)
class PolicyConfig:
    """What whoever acts with a policy should know."""

    task: str
    """The environment it learned in."""

    agent_steps: int
    """Agent steps of training; 0 where it never acted."""

    action_dim: int
    """A: numbers in an action."""

    action_repeat: int
    """Steps of the environment that an action is repeated for."""

    frames_per_second: float
    """Pictures, and so actions, a second of the environment's time; where the environment does not tell its own,
    25 steps a second are assumed."""

    pictures: PictureConfig
    """How it saw the environment."""


class Policy:
    """Acts on the pictures of one environment, of which it remembers the newest; without exploration.

    `bootifol.load_policy` makes one.

    Args:
        act: chooses actions from stacked frames.
        config: what the policy is.
    """

    def __init__(self, act: Act, config: PolicyConfig) -> None:
        self.config = config
        self._act = act
        self._stack = FrameStack(config.pictures.stack)

    def reset(self) -> None:
        """Forgets the pictures so far: the next one is the first of an episode."""
        self._stack.start()

    def act(self, frame: Frame) -> Action:
        """The action that follows the newest picture; call it once an agent step.

        Args:
            frame: uint8 `[H, W, 3]` RGB. The largest centered square of it is resized as the library's own
                environments do; one of the agent's size is taken as it is.

        Returns:
            float32 `[A]` in [-1, 1]: -1 is the environment's lower bound, 1 its upper, as with Gymnasium's
            `RescaleAction(environment, -1, 1)`.

        Raises:
            BootifolError: it is no such picture.
        """
        if not is_picture(frame):
            raise BootifolError(
                f"a policy acts on one RGB picture, a uint8 array [H, W, 3], not on {told_kind(frame)}"
            )
        pictures = self.config.pictures
        if frame.shape[:2] != (pictures.agent_size, pictures.agent_size):
            frame = resize(centered_square(frame, pictures.picture_size), pictures.agent_size)
        return self._act(
            self._stack.add(frame.copy())
        )  # the caller may draw its next one into the same memory


def write_policy(path: Path, config: PolicyConfig, agent: DrQv2) -> None:
    """Writes what an agent that sees pictures, or states of them, acts with, and what rebuilds it, as one safetensors
    file."""
    encoder, actor = agent.acting
    see = encoder if agent.eyes is None else agent.eyes
    arrays: Arrays = {
        f"{part}.{name}": to_host(parameter)
        for part, network in (("encoder", see), ("actor", actor))
        for name, parameter in network.state_dict().items()
    }
    networks: dict[str, Any] = {
        "encoder": agent.config.encoder,
        "feature_dim": agent.config.feature_dim,
        "hidden_dim": agent.config.hidden_dim,
    }
    if agent.eyes is not None:
        networks["eyes"] = [agent.eyes.width]
    about = {"format": FORMAT, "policy": dataclasses.asdict(config), "networks": networks}
    write_arrays(path, arrays, {"bootifol": json.dumps(about)})


def read_policy(path: Path) -> Policy:
    """The policy in a file of `write_policy`; it computes on the CPU. Nothing is unpickled.

    Raises:
        BootifolError: the file is missing, damaged, or of another version.
    """
    networks = read_networks(path)
    return Policy(_acting(networks), networks.config)


@dataclass(frozen=True)
class PolicyNetworks:
    """What a policy acts with."""

    config: PolicyConfig

    see: Encoder | Eyes
    """From pictures to features, or to states of which a stack is the features."""

    decide: Actor


def read_networks(path: Path) -> PolicyNetworks:
    """The networks in a file of `write_policy`, on the CPU. Nothing is unpickled.

    Raises:
        BootifolError: the file is missing, damaged, or of another version.
    """
    texts, arrays = read_texts(path, "the policy"), read_arrays(path, "the policy", verify=False)
    if "bootifol" not in texts:
        raise BootifolError(f"{path} holds no policy: name a run, or the policy.safetensors that it wrote")
    try:
        about = parsed_json(texts["bootifol"])
        if about["format"] != FORMAT:
            raise ValueError(f"its format is {about['format']}, not {FORMAT}")
        config = PolicyConfig(**about["policy"] | {"pictures": PictureConfig(**about["policy"]["pictures"])})
        networks = _rebuilt(config, arrays, **about["networks"])
    except (
        BootifolError,
        KeyError,
        TypeError,
        ValueError,
        RuntimeError,
        AttributeError,
        OverflowError,
    ) as error:
        raise BootifolError(
            f"{path} holds no policy that this version can rebuild ({told(error)}): use the version that wrote it"
        ) from error
    require_as_written(path, "the policy")  # last, for a sentence that says more goes first
    return networks


def _rebuilt(
    config: PolicyConfig,
    arrays: Arrays,
    encoder: str,
    feature_dim: int,
    hidden_dim: int,
    eyes: Sequence[int] | None = None,
) -> PolicyNetworks:
    stack, size = config.pictures.stack, config.pictures.agent_size
    with torch.device("meta"):  # torch's own initialization would draw from the global generator
        see = Encoder(encoder, 3 * stack, size) if eyes is None else Eyes(size, *eyes)  # type: ignore[arg-type]
        inputs = see.feature_count if isinstance(see, Encoder) else stack * see.feature_size
        decide = Actor(inputs, config.action_dim, feature_dim, hidden_dim)
    for prefix, network in (("encoder.", see), ("actor.", decide)):
        tensors = {
            name.removeprefix(prefix): torch.from_numpy(array.copy())
            for name, array in arrays.items()
            if name.startswith(prefix)
        }
        network.load_state_dict(tensors, assign=True)
    see.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return PolicyNetworks(config, see, decide)


def _acting(networks: PolicyNetworks) -> Act:
    see, decide = networks.see, networks.decide
    if isinstance(see, Eyes):
        states = StackedStates(see, networks.config.pictures.stack)
        encode: Callable[[Tensor], Tensor] = lambda pictures: as_features(states(pictures))  # noqa: E731
    else:
        encode = lambda pictures: see(pictures.float())  # noqa: E731

    def act(observation: Observation) -> Action:
        with torch.inference_mode():
            action: Action = to_host(decide(encode(as_batch(observation)))[0])
            return action

    return act
