"""Computing elsewhere than on the CPU, on machines that have nothing else.

PyTorch's `meta` device stands in for a GPU. Its tensors have shapes and no numbers, so an operation that mixes them
with the CPU's fails, as on a GPU, and so does whatever looks at a number: what runs through needs no round trip to the
host.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import torch

from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.inverse_dynamics import InverseDynamics
from bootifol.cli.main import main
from bootifol.devices import chosen_device, to_device, to_floats, to_host
from bootifol.errors import BootifolError
from bootifol.presets import SMOKE
from bootifol.rewards.registry import METHODS, make_reward_model
from bootifol.tracking import Averages
from bootifol.training.config import TrainingConfig
from bootifol.types import Batch, FrameBatch, Video

SIZE, STACK, ACTIONS, BATCH, FRAMES = 32, 2, 3, 4, 11
AGENT = DrQv2Config(
    feature_dim=8,
    hidden_dim=16,
    precision="fp32",
    ema_decay=0.9,
    cloning_weight=1.0,
    saturation_weight=0.1,
)


class Noise:
    """Videos of random pixels."""

    def __len__(self) -> int:
        return 4

    def __getitem__(self, index: int) -> Video:
        return Video(f"noise-{index}", self.sample(1, np.random.default_rng(index))[0])

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return rng.integers(0, 256, (count, FRAMES, SIZE, SIZE, 3), dtype=np.uint8)


@pytest.fixture
def fetched(monkeypatch: pytest.MonkeyPatch) -> list[torch.Size]:
    """Lets networks compute on `meta`; the shapes of what the host has fetched from there so far."""
    shapes: list[torch.Size] = []

    def cpu(tensor: torch.Tensor) -> torch.Tensor:
        if tensor.device.type == "cpu":
            return tensor
        shapes.append(tensor.shape)
        return torch.ones(tensor.shape, dtype=tensor.dtype)

    monkeypatch.setattr(torch.Tensor, "cpu", cpu)
    monkeypatch.setattr(torch, "autocast", lambda *_, **__: nullcontext())
    optimizer = import_module("torch.optim.optimizer")
    monkeypatch.setattr(optimizer, "_get_fused_kernels_supported_devices", lambda: ["cpu", "meta"])
    return shapes


def make_batch() -> Batch:
    pictures = torch.zeros(BATCH, 3 * STACK, SIZE, SIZE, dtype=torch.uint8)
    return Batch(
        observation=pictures,
        action=torch.zeros(BATCH, ACTIONS),
        reward=torch.zeros(BATCH),
        discount=torch.zeros(BATCH),
        next_observation=pictures,
        demonstrated=torch.arange(BATCH) >= 2,
    )


def make_agent(device: str) -> DrQv2:
    return DrQv2(AGENT, SIZE, STACK, ACTIONS, seed=0, device=device)


def make_inverse_dynamics() -> InverseDynamics:
    """On `meta`, in bfloat16 throughout, since there is no autocast."""
    model = InverseDynamics("strided", SIZE, STACK, 1, ACTIONS, seed=0, hidden_dim=16, device="meta")
    model.network.to(torch.bfloat16)
    return model


LEARNING: dict[str, Callable[[], object]] = {
    "update": lambda: make_agent("meta").update(make_batch(), 0),
    "clone": lambda: make_agent("meta").clone(make_batch(), 1e-3),
    "inverse_dynamics": lambda: make_inverse_dynamics().update(make_batch(), 1e-3),
}


@pytest.mark.parametrize("what", list(LEARNING))
def test_the_agent_learns_without_a_round_trip_to_the_host(fetched: list[torch.Size], what: str) -> None:
    LEARNING[what]()
    assert fetched == []


def test_of_an_action_the_host_fetches_the_action_alone(fetched: list[torch.Size]) -> None:
    agent = make_agent("meta")
    observation = np.zeros((SIZE, SIZE, 3 * STACK), np.uint8)
    for explore in (True, False):
        assert agent.act(observation, 0, explore).shape == (ACTIONS,)
    assert fetched == [(ACTIONS,)] * 2
    fetched.clear()
    frames = np.zeros((FRAMES, SIZE, SIZE, 3), np.uint8)
    assert make_inverse_dynamics().actions(frames).shape == (FRAMES - 1, ACTIONS)
    assert fetched == [(FRAMES - 1, ACTIONS)]


@pytest.mark.parametrize(
    ("method", "wanted"), [("bootifol", 2), ("virl", 1), ("context_translation", 1), ("gaifo", 1)]
)
def test_a_reward_model_fetches_a_step_once_and_an_episode_once(
    fetched: list[torch.Size], method: str, wanted: int
) -> None:
    """BootIfOL's fetches the distances of which the reward scale is made, too."""
    config = replace(SMOKE.reward, **{method: replace(getattr(SMOKE.reward, method), precision="fp32")})
    model = make_reward_model(method, config, SIZE, 0, "meta")
    assert next(model.align(Noise(), Noise()), None) or model.update(Noise(), Noise())
    assert len(fetched) == wanted
    assert max(shape.numel() for shape in fetched) < 100
    fetched.clear()
    rewards = model.label(Noise()[0], [Noise()[index] for index in range(model.reference_count)])
    assert rewards.shape == (FRAMES - 1,)
    assert fetched == [(FRAMES - 1,)]


def test_every_method_that_learns_is_tried_above() -> None:
    assert set(METHODS) == {"bootifol", "virl", "context_translation", "gaifo", "environment"}


def kept(agent: DrQv2) -> list[torch.Tensor]:
    """What the optimizers keep."""
    states = [state for optimizer in agent._optimizers().values() for state in optimizer.state.values()]
    return [value for state in states for value in state.values()]


def test_a_checkpoint_of_one_device_goes_on_on_another(fetched: list[torch.Size]) -> None:
    agent, other = make_agent("cpu"), make_agent("meta")
    for learner in (agent, other):
        learner.clone(make_batch(), 1e-3)
        learner.update(make_batch(), 0)
    other.load_state(agent.state())
    assert {tensor.device.type for tensor in (*other._networks().parameters(), *kept(other))} == {"meta"}
    assert len(kept(other)) == len(kept(agent)) > 0
    other.update(make_batch(), 0)
    assert {name: array.shape for name, array in other.state().items()} == {
        name: array.shape for name, array in agent.state().items()
    }
    agent.load_state(other.state())  # which are ones: the stand-in has no numbers to give back
    agent.update(make_batch(), 0)


def test_metrics_stay_where_they_are_until_they_are_logged(fetched: list[torch.Size]) -> None:
    averages = Averages()
    for step in range(3):
        averages.add({"agent/q": torch.zeros((), device="meta"), "agent/exploration": float(step)})
    assert fetched == []
    assert averages.pop() == {"agent/q": 1.0, "agent/exploration": 1.0}
    assert fetched == [(3,)]
    assert averages.pop() == {}


def test_a_loss_that_was_not_looked_at_is_refused_when_it_is_logged() -> None:
    averages = Averages()
    for loss in (1.0, float("nan"), 2.0):
        averages.add({"agent/actor_loss": torch.tensor(loss)})
    with pytest.raises(
        BootifolError, match=r"agent/actor_loss was not a finite number.*lower the learning rate"
    ):
        averages.pop()


def test_a_gpu_is_told_to_skip_steps_that_are_not_finite(fetched: list[torch.Size]) -> None:
    agent = make_agent("meta")
    agent.update(make_batch(), 0)
    agent.clone(make_batch(), 1e-3)
    for optimizer in (agent._critic_optimizer, agent._actor_optimizer, agent._cloning_optimizer):
        assert optimizer.found_inf.device.type == "meta"


@pytest.mark.parametrize("skips", [False, True])
def test_fused_adam_skips_a_step_when_told_so(skips: bool) -> None:
    """What a GPU does with it; the CPU's fused Adam reads the same flag."""
    parameter = torch.ones(3, requires_grad=True)
    optimizer = torch.optim.Adam([parameter], fused=True)
    parameter.grad = torch.full((3,), float("nan") if skips else 1.0)
    optimizer.found_inf = torch.tensor(float(skips))  # type: ignore[attr-defined]
    optimizer.step()
    assert torch.equal(parameter.detach(), torch.ones(3)) == skips
    assert optimizer.state[parameter]["step"] == (0 if skips else 1)


def test_to_floats_keeps_the_order_of_numbers_and_tensors() -> None:
    values = [1.0, torch.tensor(2.0, requires_grad=True), 3.0, torch.tensor(4.0, dtype=torch.bfloat16)]
    assert to_floats(values) == [1.0, 2.0, 3.0, 4.0]
    assert to_floats([0.1]) == [0.1]


def test_on_the_cpu_nothing_is_copied() -> None:
    tensor = torch.zeros(2, requires_grad=True)
    assert to_device(tensor, torch.device("cpu")) is tensor
    assert to_host(tensor).ctypes.data == tensor.data_ptr()


def test_a_gpu_copies_from_pinned_memory_while_the_host_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    copies: list[tuple[bool, object, object]] = []
    pinned = torch.ones(2)
    monkeypatch.setattr(torch.Tensor, "pin_memory", lambda tensor: pinned)
    monkeypatch.setattr(
        torch.Tensor,
        "to",
        lambda tensor, device, non_blocking=False: copies.append((tensor is pinned, device, non_blocking)),
    )
    to_device(torch.zeros(2), torch.device("cuda"))
    assert copies == [(True, torch.device("cuda"), True)]


@pytest.mark.parametrize(("there", "meant"), [(False, "cpu"), (True, "cuda")])
def test_auto_takes_a_gpu_where_there_is_one(
    monkeypatch: pytest.MonkeyPatch, there: bool, meant: str
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: there)
    assert chosen_device("auto") == meant
    assert chosen_device("cpu") == "cpu"


def test_a_gpu_is_chosen_by_its_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cuda.device_count", lambda: 2)
    assert [chosen_device(name) for name in ("cuda", "cuda:0", "cuda:1")] == ["cuda", "cuda:0", "cuda:1"]
    with pytest.raises(BootifolError, match="cannot compute on cuda:2 here: choose --device auto"):
        chosen_device("cuda:2")


@pytest.mark.parametrize("name", ["gpu", "meta", "cuda:", "cuda:one", "cpu:0", ""])
def test_a_configuration_refuses_what_is_no_device(name: str) -> None:
    with pytest.raises(BootifolError, match="device must be auto, cpu, cuda, cuda:NUMBER or mps, not"):
        TrainingConfig(device=name)


def test_train_says_in_a_sentence_that_a_device_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("torch.cuda.device_count", lambda: 0)
    out = tmp_path / "run"
    words = [
        "train",
        "--preset",
        "smoke",
        "--task",
        "drawn_reach",
        "--demos",
        str(tmp_path),
        "--out",
        str(out),
    ]
    assert main([*words, "--device", "cuda"]) == 2
    assert "PyTorch cannot compute on cuda here: choose" in capsys.readouterr().err
    assert not out.exists()
