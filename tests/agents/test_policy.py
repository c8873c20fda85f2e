"""A policy outside of the library: what it makes of raw pictures, and the file that holds it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from benchmarks.page_modules import USE_A_POLICY, write_page_modules
from safetensors.numpy import load_file, save_file

from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.policy import Policy, PolicyConfig, read_policy, write_policy
from bootifol.envs.any_gymnasium import GymnasiumSimulator
from bootifol.envs.drawn import DrawnReach
from bootifol.envs.pictures import PictureConfig
from bootifol.envs.pixels import PixelEnvironment
from bootifol.errors import BootifolError
from bootifol.types import Action, Observation

PICTURES = PictureConfig(agent_size=24, video_size=32)
CONFIG = PolicyConfig("drawn_reach", 120, 2, action_repeat=2, frames_per_second=5.0, pictures=PICTURES)
AGENT = DrQv2Config(encoder="strided", feature_dim=8, hidden_dim=16, ema_decay=0.9)


class WideReach(gymnasium.Env[Any, Any]):
    """The drawn task in wide pictures, always in the same memory, with its own range of actions and reward."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012
    render_mode = "rgb_array"
    action_space = gymnasium.spaces.Box(np.float32([-2.0, 0.0]), np.float32([2.0, 1.0]), dtype=np.float32)

    def __init__(self) -> None:
        self.reach = DrawnReach(PictureConfig(40, 40))
        self.memory = np.zeros((40, 56, 3), np.uint8)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[None, dict[str, Any]]:
        self.reach.reset(seed or 0)
        return None, {}

    def step(self, action: Any) -> tuple[None, float, bool, bool, dict[str, Any]]:
        self.reach.step(np.float32([action[0] / 2.0, 2.0 * action[1] - 1.0]))
        return None, float(self.reach.dot @ (1.0, 2.0)), False, False, {}

    def render(self) -> Any:
        self.memory[:, 7:47] = self.reach.render()
        return self.memory


def make() -> WideReach:
    return WideReach()


def agent(config: DrQv2Config = AGENT) -> DrQv2:
    made = DrQv2(config, PICTURES.agent_size, PICTURES.stack, action_dim=2, seed=3)
    encoder, _ = made.acting
    with torch.no_grad():  # what is averaged differs from what is newest
        next(iter(encoder.parameters())).add_(0.01)
    return made


def own_environment(pictures: PictureConfig) -> PixelEnvironment:
    return PixelEnvironment(
        GymnasiumSimulator(f"{__name__}:make", pictures), pictures, CONFIG.action_repeat, 12
    )


def swerving(observation: Observation) -> Action:
    """Actions that depend on every pixel of every frame."""
    sums = observation.reshape(-1, observation.shape[2]).sum(axis=0, dtype=np.float64)
    return np.sin(sums[[0, -1]] + sums.sum()).astype(np.float32)


@pytest.mark.parametrize("sizes", [(24, 32), (32, 24), (40, 40), (24, 24)])
def test_raw_pictures_become_what_the_librarys_own_environment_shows(sizes: tuple[int, int]) -> None:
    pictures = PictureConfig(*sizes)
    environment = own_environment(pictures)
    seen: list[np.ndarray] = []

    def noting(observation: Observation) -> Action:
        seen.append(observation.copy())
        return swerving(observation)

    policy = Policy(noting, replace(CONFIG, pictures=pictures))
    for seed in (1, 2):
        seen.clear()
        policy.reset()
        shown = [environment.reset(seed=seed)[0]]
        wide = gymnasium.wrappers.RescaleAction(make(), -1, 1)
        wide.reset(seed=seed)
        for _ in range(8):
            action = policy.act(wide.render())
            shown.append(environment.step(action)[0])
            for _ in range(CONFIG.action_repeat):
                wide.step(action)
        np.testing.assert_array_equal(seen, shown[:8])
    assert len(np.unique([frames.sum() for frames in seen])) > 4


def test_pictures_of_the_agents_size_are_taken_as_they_are() -> None:
    environment = own_environment(PICTURES)
    seen: list[np.ndarray] = []

    def noting(observation: Observation) -> Action:
        seen.append(observation)
        return swerving(observation)

    policy = Policy(noting, CONFIG)
    observation, info = environment.reset(seed=4)
    for _ in range(6):
        action = policy.act(info["frame"])
        np.testing.assert_array_equal(seen[-1], observation)
        observation, *_, info = environment.step(action)


@pytest.mark.parametrize("encoder", ["paper", "strided", "coarse"])
@pytest.mark.parametrize("ema_decay", [0.0, 0.9])
def test_a_file_acts_as_the_agent_bit_for_bit(tmp_path: Path, encoder: Any, ema_decay: float) -> None:
    pictures = replace(PICTURES, agent_size=36)
    trained = DrQv2(replace(AGENT, encoder=encoder, ema_decay=ema_decay), 36, 3, action_dim=2, seed=3)
    write_policy(tmp_path / "policy.safetensors", replace(CONFIG, pictures=pictures), trained)
    state = torch.random.get_rng_state()
    policy = read_policy(tmp_path / "policy.safetensors")
    assert torch.equal(torch.random.get_rng_state(), state), "others draw from it, too"
    assert policy.config == replace(CONFIG, pictures=pictures)
    rng = np.random.default_rng(0)
    for _ in range(4):
        frame = rng.integers(0, 256, (36, 36, 3), np.uint8)
        policy.reset()
        action = policy.act(frame)
        assert (action.shape, action.dtype) == ((2,), np.float32) and np.abs(action).max() <= 1.0
        expected = trained.act(np.concatenate([frame] * 3, axis=2), 0, explore=False)
        np.testing.assert_array_equal(action, expected)


def test_the_file_holds_the_averaged_encoder_and_actor_alone(tmp_path: Path) -> None:
    trained = agent()
    write_policy(tmp_path / "policy.safetensors", CONFIG, trained)
    arrays = load_file(tmp_path / "policy.safetensors")
    assert {name.partition(".")[0] for name in arrays} == {"encoder", "actor"}
    state = trained.state()
    for name, array in arrays.items():
        np.testing.assert_array_equal(array, state[f"averaged_{name}"])
    assert (arrays["encoder.first.weight"] != state["encoder.first.weight"]).any()


@pytest.mark.parametrize(
    ("frame", "found"),
    [
        (np.zeros((8, 8, 3)), r"float64 \[8, 8, 3\]"),
        (np.zeros((8, 8), np.uint8), r"uint8 \[8, 8\]"),
        (np.zeros((1, 8, 8, 3), np.uint8), r"uint8 \[1, 8, 8, 3\]"),
        (np.zeros((8, 8, 9), np.uint8), r"uint8 \[8, 8, 9\]"),
        (np.zeros((0, 8, 3), np.uint8), r"uint8 \[0, 8, 3\]"),
        ([[1]], "list"),
    ],
)
def test_what_is_no_picture_gets_a_sentence(frame: Any, found: str) -> None:
    with pytest.raises(BootifolError, match=rf"one RGB picture, a uint8 array \[H, W, 3\], not on {found}"):
        Policy(swerving, CONFIG).act(frame)


def test_files_that_hold_no_policy_get_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    with pytest.raises(BootifolError, match="the policy is missing"):
        read_policy(path)
    save_file({"a": np.zeros(2)}, path)
    with pytest.raises(BootifolError, match=r"holds no policy: name a run"):
        read_policy(path)
    write_policy(path, CONFIG, agent())
    whole = path.read_bytes()
    for wrong, reason in (
        ((b'\\"format\\": 1', b'\\"format\\": 2'), "its format is 2, not 1"),
        ((b'\\"strided\\"', b'\\"striped\\"'), "striped"),
        ((b'\\"stack\\"', b'\\"stuck\\"'), "stuck"),
        ((b'\\"hidden_dim\\": 16', b'\\"hidden_dim\\": 17'), "size mismatch"),
    ):
        assert wrong[0] in whole
        path.write_bytes(whole.replace(*wrong))
        with pytest.raises(BootifolError, match=rf"that this version can rebuild \(.*{reason}") as raised:
            read_policy(path)
        assert "\n" not in str(raised.value)
    path.write_bytes(whole[:-100])
    with pytest.raises(BootifolError, match="the policy is damaged or incomplete"):
        read_policy(path)


def test_the_pages_loop_plays_as_the_librarys_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_page_modules(USE_A_POLICY, tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    from act import play  # type: ignore[import-not-found]

    trained = agent()
    environment = own_environment(PICTURES)
    observation, _ = environment.reset(seed=5)
    total, over = 0.0, False
    while not over:
        action = trained.act(observation, 0, explore=False)
        observation, reward, terminated, truncated, _ = environment.step(action)
        total, over = total + reward, terminated or truncated
    write_policy(tmp_path / "policy.safetensors", CONFIG, trained)
    limited = gymnasium.wrappers.TimeLimit(make(), 12 * CONFIG.action_repeat)
    assert play(read_policy(tmp_path / "policy.safetensors"), limited, seed=5) == pytest.approx(
        total, abs=1e-4
    )
    assert total != 0.0
