"""Gymnasium environments that cost nothing, good ones and bad ones; registered as Tiny/…"""

from __future__ import annotations

import os
import random
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, Discrete

HEIGHT, WIDTH = 20, 32


class Slide(gymnasium.Env[dict[str, Any], Any]):
    """A white column that slides; the picture is wider than high. It ends at the right border."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012
    observation_space = Dict({"place": Box(-1.0, 1.0, (1,))})

    def __init__(self, render_mode: str | None = None, cut_at: int | None = None) -> None:
        self.render_mode = render_mode
        self.action_space: gymnasium.Space[Any] = Box(np.float32([-1.0, 2.0]), np.float32([1.0, 6.0]))
        self.cut_at = cut_at
        self.place = 0.0
        self.steps = 0
        self.actions: list[np.ndarray] = []

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[dict[str, Any], dict[str, Any]]:
        super().reset(seed=seed)
        self.place = float(self.np_random.uniform(-0.9, 0.5))
        self.steps = 0
        return {"place": np.float32([self.place])}, {}

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        assert self.action_space.contains(action), action
        self.actions.append(action)
        self.steps += 1
        self.place = float(np.clip(self.place + 0.1 * action[0], -1.0, 1.0))
        ended = self.place > 0.95
        cut = self.steps == self.cut_at
        return {"place": np.float32([self.place])}, self.place, ended, cut, {"is_success": np.bool_(ended)}

    def render(self) -> Any:
        picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        picture[:, :6] = (255, 0, 0)  # what the centered square leaves out
        column = round(16 + 9 * self.place)
        picture[:, column - 1 : column + 1] = 255
        return picture


class Other(Slide):
    """The same with one thing changed by its arguments."""

    def __init__(self, render_mode: str | None = None, **changes: Any) -> None:
        super().__init__(render_mode)
        for name, value in changes.items():
            setattr(self, name, value)


class Blind(Slide):
    metadata = {"render_modes": ["human"], "render_fps": 20}  # noqa: RUF012


class WithoutRenderMode(Slide):
    def __init__(self) -> None:
        super().__init__()


def make() -> Slide:
    return Slide("rgb_array")


def make_without_time() -> Slide:
    environment = Slide("rgb_array")
    environment.metadata = {"render_modes": ["rgb_array"]}
    return environment


def make_number() -> int:
    return 3


def make_failing() -> Slide:
    raise RuntimeError("no robot is plugged in")


def make_limited_inside() -> gymnasium.Env[Any, Any]:
    """A time limit below another wrapper, where `gymnasium.make` would not put it."""
    return gymnasium.wrappers.OrderEnforcing(gymnasium.wrappers.TimeLimit(Slide("rgb_array"), 4))


def register() -> None:
    """Fills Gymnasium's registry; may be called again."""
    for name, kind, steps, changes in (
        ("Slide", Slide, 7, {}),
        ("Endless", Slide, None, {}),
        ("Cut", Slide, 50, {"cut_at": 3}),
        ("Discrete", Other, 7, {"action_space": Discrete(3)}),
        ("DictActions", Other, 7, {"action_space": Dict({"a": Box(-1.0, 1.0, (1,))})}),
        ("Unbounded", Other, 7, {"action_space": Box(-np.inf, np.inf, (2,))}),
        ("Blind", Blind, 7, {}),
        ("WithoutRenderMode", WithoutRenderMode, 7, {}),
        ("ManyPictures", Other, 7, {"render": lambda: [np.zeros((4, 4, 3), np.uint8)]}),
        ("Gray", Other, 7, {"render": lambda: np.zeros((4, 4), np.uint8)}),
    ):
        identifier = f"Tiny/{name}-v0"
        if identifier not in gymnasium.registry:
            gymnasium.register(identifier, kind, max_episode_steps=steps, kwargs=changes)
    if "Tiny/Missing-v0" not in gymnasium.registry:
        gymnasium.register("Tiny/Missing-v0", "a_package_that_is_missing:Environment")


class OldReset(Slide):
    """As gym before 0.26: seeded by a method, and `reset` returns the observation alone."""

    def seed(self, seed: int | None = None) -> list[int | None]:
        self.np_random = np.random.default_rng(seed)
        return [seed]

    def reset(self) -> Any:  # type: ignore[override]
        self.place, self.steps = float(self.np_random.uniform(-0.9, 0.5)), 0
        return {"place": np.float32([self.place])}


class OldStep(Slide):
    """Four values; its end is a time limit where `cut_at` says so."""

    def step(self, action: Any) -> Any:
        observation, reward, ended, cut, info = super().step(action)
        return observation, reward, ended or cut, info | ({"TimeLimit.truncated": True} if cut else {})


class Answering(Slide):
    """Answers a step with one thing changed: `reward`, `info` or `values`."""

    def __init__(self, render_mode: str | None = "rgb_array", **changed: Any) -> None:
        super().__init__(render_mode)
        self.changed = changed

    def step(self, action: Any) -> Any:
        observation, reward, ended, cut, info = super().step(action)
        ended = self.changed.get("ended", ended)
        answer = (observation, self.changed.get("reward", reward), ended, cut, self.changed.get("info", info))
        return answer[: self.changed.get("values", 5)]


class SeedIgnored(Slide):
    """Draws its starts as `draw` says, whatever seed it is given."""

    def __init__(self, draw: str) -> None:
        super().__init__("rgb_array")
        self.draw = draw
        self.own = np.random.default_rng(0)  # two starts that no picture confuses

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        drawn = {
            "numpy": lambda: np.random.uniform(-0.9, 0.5),
            "python": lambda: random.uniform(-0.9, 0.5),
            "before it seeds": lambda: self.np_random.uniform(-0.9, 0.5),
            "its own": lambda: self.own.uniform(-0.9, 0.5),
        }
        self.place, self.steps = float(drawn[self.draw]()), 0
        return {"place": np.float32([self.place])}, {}


class Private(Slide):
    """Keeps its generator to itself, and `reset` knows no info."""

    np_random = property(lambda self: self._generator)  # type: ignore[assignment]

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self._generator = np.random.default_rng(seed)
        self.place, self.steps = float(self._generator.uniform(-0.9, 0.5)), 0
        return {"place": np.float32([self.place])}, None


class Blank(Slide):
    """Draws nothing before a step, or nothing with SDL's dummy driver, as highway-env."""

    def __init__(self, until_step: int = 0, color: int = 0) -> None:
        super().__init__("rgb_array")
        self.until_step, self.color = until_step, color

    def render(self) -> Any:
        picture = super().render()
        if os.environ.get("SDL_VIDEODRIVER") == "dummy" or self.steps < self.until_step:
            picture[:] = self.color
        return picture


def make_old_reset() -> gymnasium.Env[Any, Any]:
    return OldReset("rgb_array")


def make_old_reset_wrapped() -> gymnasium.Env[Any, Any]:
    return gymnasium.wrappers.TimeLimit(gymnasium.wrappers.OrderEnforcing(OldReset("rgb_array")), 9)


def make_old_step() -> gymnasium.Env[Any, Any]:
    return OldStep("rgb_array", cut_at=3)


def make_old_step_wrapped() -> gymnasium.Env[Any, Any]:
    return gymnasium.wrappers.TransformReward(OldStep("rgb_array"), lambda reward: 2 * reward)


def make_array_reward() -> gymnasium.Env[Any, Any]:
    return Answering(reward=np.array([[0.5]], np.float32))


def make_two_rewards() -> gymnasium.Env[Any, Any]:
    return Answering(reward=np.array([0.5, 1.0]))


def make_no_reward() -> gymnasium.Env[Any, Any]:
    return Answering(reward=None)


def make_two_ends() -> gymnasium.Env[Any, Any]:
    return Answering(ended=np.array([False, True]))


def make_worded_reward() -> gymnasium.Env[Any, Any]:
    return Answering(reward="good")


def make_no_info() -> gymnasium.Env[Any, Any]:
    return Answering(info=None)


def make_array_success() -> gymnasium.Env[Any, Any]:
    return Answering(info={"success": np.array([1.0])})


def make_two_successes() -> gymnasium.Env[Any, Any]:
    return Answering(info={"success": np.array([True, False])})


def make_three_values() -> gymnasium.Env[Any, Any]:
    return Answering(values=3)


def make_diverging() -> gymnasium.Env[Any, Any]:
    environment = Slide("rgb_array")

    def step(action: Any) -> Any:
        raise RuntimeError("Physics diverged")

    environment.step = step  # type: ignore[method-assign]
    return environment


def make_ignoring_numpy() -> gymnasium.Env[Any, Any]:
    return SeedIgnored("numpy")


def make_ignoring_python() -> gymnasium.Env[Any, Any]:
    return SeedIgnored("python")


def make_ignoring_before() -> gymnasium.Env[Any, Any]:
    return SeedIgnored("before it seeds")


def make_ignoring_own() -> gymnasium.Env[Any, Any]:
    return SeedIgnored("its own")


def make_blank() -> gymnasium.Env[Any, Any]:
    return Blank(until_step=10**9)


def make_blank_white() -> gymnasium.Env[Any, Any]:
    return Blank(until_step=10**9, color=255)


def make_blank_at_first() -> gymnasium.Env[Any, Any]:
    return Blank(until_step=4)


def make_blank_if_dummy() -> gymnasium.Env[Any, Any]:
    return Blank()


def make_private() -> gymnasium.Env[Any, Any]:
    return Private("rgb_array")
