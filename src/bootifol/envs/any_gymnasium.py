"""Any Gymnasium environment with continuous actions that renders pictures, by its ID or by a function that makes it."""

from __future__ import annotations

import atexit
import os
import sys
import warnings
import weakref
from typing import Any

import gymnasium
import numpy as np
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

from bootifol.envs.camera import prepare_opengl
from bootifol.envs.other_answers import (
    Environment,
    one_number,
    seeded,
    success_of,
    told_as_a_sentence,
    with_todays_answers,
)
from bootifol.envs.pictures import PictureConfig, centered_square, is_picture, told_kind
from bootifol.errors import BootifolError, warn
from bootifol.plugins import allow, is_own_name, own_callable, plugins, told, where
from bootifol.types import Action, Frame

PREFIX = "gymnasium:"
"""What a name of Gymnasium's registry begins with; any other name is `module:function`."""

ASSUMED_STEP_SECONDS = 1.0 / 25.0
"""Time of a step where the environment does not tell."""

SUPPORTED = "bootifol acts with continuous actions: one gymnasium.spaces.Box of floats with finite bounds"

LOOKED_AT_STEPS = 10
"""Steps of random actions until an environment must have drawn something."""

SAME_START_LEVELS = 8
"""Levels of 255 by which a pixel may differ between two starts with one seed: renderers are rarely exact."""

_open_simulators: weakref.WeakSet[GymnasiumSimulator] = weakref.WeakSet()


class GymnasiumSimulator:
    """Shows an environment's `render()` as square pictures; its observations are not used.

    Args:
        name: `gymnasium:ID` or `module:function`, or the name of an installed package's task.
        pictures: size of the pictures; the render profile makes no difference.

    Raises:
        BootifolError: it cannot be made, acts otherwise than `SUPPORTED`, or renders no RGB pictures.
    """

    def __init__(self, name: str, pictures: PictureConfig) -> None:
        self.name = name
        made, self.time_limit = without_time_limit(make(name))
        self.environment = with_todays_answers(made)
        """Without the environment's own time limit, which is kept here in steps (None: it has none)."""
        space = _action_space(name, self.environment)
        _require_pictures(name, self.environment)
        self.action_dim = int(np.prod(space.shape))
        self.action_shape, self._dtype = space.shape, space.dtype
        self._low, self._high = space.low.astype(np.float64), space.high.astype(np.float64)
        seconds = step_seconds(self.environment)
        self.knows_time = seconds is not None
        self.step_seconds = ASSUMED_STEP_SECONDS if seconds is None else seconds
        self.truncated = False
        self.observation: Any = None
        """What the environment itself observed last, for a policy of the user's; no learner reads it."""
        self._size = pictures.picture_size
        # What cannot be shown is refused here, before anyone has written a file.
        self.reset(seed=0)
        self.render()

    def reset(self, seed: int) -> None:
        self.truncated = False
        with told_as_a_sentence(self.name, "reset()"), seeded(self.environment, seed):
            self.observation, _ = self.environment.reset(seed=seed)

    def step(self, action: Action) -> tuple[float, bool, bool | None]:
        part = (np.asarray(action, np.float64).reshape(self.action_shape) + 1.0) / 2.0
        scaled = (self._low + part * (self._high - self._low)).astype(self._dtype)
        with told_as_a_sentence(self.name, "step()"):
            self.observation, reward, terminated, truncated, info = self.environment.step(scaled)
        self.truncated = bool(one_number(self.name, "truncated", truncated))
        ended = bool(one_number(self.name, "terminated", terminated))
        return one_number(self.name, "the reward", reward), ended, success_of(self.name, info)

    def in_unit_range(self, action: NDArray[np.float64]) -> Action:
        """An action between the environment's own bounds as `step` takes it, float32 `[A]` in [-1, 1]."""
        part = (action - self._low) / np.maximum(self._high - self._low, 1e-12)
        return (2.0 * part - 1.0).clip(-1.0, 1.0).astype(np.float32).reshape(-1)

    def require_sights(self) -> None:
        """Looks whether anything is drawn, and whether starts follow from their seed, of which it warns.

        Raises:
            BootifolError: every picture is of one color, or a step's answer cannot be used.
        """
        starts = []
        for _ in range(2):
            self.reset(seed=0)
            starts.append(self.render().astype(np.int16))
        if np.abs(starts[0] - starts[1]).max() > SAME_START_LEVELS:
            warn(
                f"{self.name} starts elsewhere when it is reset twice with one seed, so evaluations of it cannot be "
                "compared: let its reset draw from self.np_random alone, after super().reset(seed=seed)"
            )
        seen, rng, over = starts[1], np.random.default_rng(0), False
        for number in range(LOOKED_AT_STEPS):
            # One step at least, for what it answers may be unfit, too.
            if number > 0 and (np.ptp(seen, axis=(0, 1)) > 0).any():
                return
            if not over:
                _, over, _ = self.step(rng.uniform(-1, 1, self.action_dim).astype(np.float32))
            seen = self.render().astype(np.int16)
        driver = os.environ.get("SDL_VIDEODRIVER")
        hint = (
            f"; SDL_VIDEODRIVER is {driver}, and some draw nothing then: unset it"
            if driver == "dummy"
            else ""
        )
        raise BootifolError(
            f"{self.name} draws nothing: every picture is of one color, {told_color(seen)}, at its start and in "
            f"{LOOKED_AT_STEPS} steps{hint}"
        )

    def render(self) -> Frame:
        """The current state, uint8 `[P, P, 3]`: the largest centered square of what the environment renders.

        Raises:
            BootifolError: it renders something else than a picture, or cannot render here.
        """
        viewer = self._mujoco_viewer()
        if viewer is not None:
            # Gymnasium's MuJoCo renderers draw into whichever OpenGL context is current, be it another's.
            viewer.make_context_current()
        try:
            picture = self.environment.render()
        except Exception as error:  # each renderer fails with exceptions of its own
            raise BootifolError(
                f"{self.name} cannot render pictures here: {told(error)} (is a package missing, or OpenGL? "
                "`bootifol doctor` tries the latter)"
            ) from error
        if not is_picture(picture):
            raise BootifolError(
                f"{self.name} renders {told_kind(picture)} where a picture is wanted: make its render() return a "
                "uint8 array [height, width, 3]"
            )
        _close_at_exit(self)
        # A copy, for an environment may draw its next picture into the same memory.
        return centered_square(picture, self._size).copy()

    def close(self) -> None:
        viewer = self._mujoco_viewer()
        if viewer is not None:
            # They also free their OpenGL context before the objects in it, which then go from another's.
            viewer.make_context_current()
            viewer.con.free()
        self.environment.close()
        _open_simulators.discard(self)

    def _mujoco_viewer(self) -> Any:
        """The renderer of Gymnasium's MuJoCo environments once it has rendered; None for all others."""
        return getattr(getattr(self.environment.unwrapped, "mujoco_renderer", None), "viewer", None)


def make(name: str) -> Environment:
    """Makes an environment that renders RGB pictures.

    Args:
        name: `gymnasium:ID`, where ID may begin with a module to import first (`gymnasium:package:ID`), or
            `module:function`, where the module may lie in the current directory.

    Raises:
        BootifolError: the name is unknown, something it needs is missing, or it makes something else.
    """
    _prepare_rendering()
    if name.startswith(PREFIX):
        allow(name)
        return _registered(name)
    return _made_by_function(name)


def without_time_limit(environment: Environment) -> tuple[Environment, int | None]:
    """The environment without `TimeLimit` wrappers, at whatever depth, and the steps of the shortest (or None)."""
    limits = []
    while isinstance(environment, TimeLimit):
        limits.append(environment._max_episode_steps)
        environment = environment.env
    wrapper = environment
    while isinstance(wrapper, gymnasium.Wrapper):
        if isinstance(wrapper.env, TimeLimit):
            limits.append(wrapper.env._max_episode_steps)
            wrapper.env = wrapper.env.env
        else:
            wrapper = wrapper.env
    return environment, min(limits, default=None)


def step_seconds(environment: Environment) -> float | None:
    """Time of one step, or None where the environment does not tell.

    `metadata["render_fps"]` goes before `dt`, since it is the speed at which Gymnasium's own tools write videos.
    """
    rate = _positive((environment.metadata or {}).get("render_fps"))
    return _positive(getattr(environment.unwrapped, "dt", None)) if rate is None else 1.0 / rate


def told_color(picture: NDArray[np.int16]) -> str:
    """The color of a picture's first pixel, for a sentence."""
    red, green, blue = (int(level) for level in picture[0, 0])
    names = {(0, 0, 0): "black", (255, 255, 255): "white"}
    return names.get((red, green, blue), f"RGB {red}, {green}, {blue}")


def _positive(value: Any) -> float | None:
    """A number, of whatever kind numpy or Python has, if it is one above 0."""
    try:
        number = float(np.asarray(value, dtype=np.float64).reshape(()))
    except (TypeError, ValueError):
        return None
    return number if 0 < number < np.inf else None


def _registered(name: str) -> Environment:
    identifier = name.removeprefix(PREFIX)
    try:
        with warnings.catch_warnings():
            # A missing render mode gets a sentence of its own.
            warnings.filterwarnings("ignore", message=".*render_mode")
            environment: Environment = gymnasium.make(
                identifier, render_mode="rgb_array", disable_env_checker=True
            )
    except gymnasium.error.UnregisteredEnv as error:
        raise BootifolError(
            f"Gymnasium has no environment '{identifier}' ({told(error).rstrip('.')}); if another package registers "
            f"it, name that package too: {PREFIX}PACKAGE:{identifier.rpartition(':')[2]}"
        ) from error
    except (ImportError, gymnasium.error.DependencyNotInstalled) as error:
        raise BootifolError(
            f"{name} needs a package that is missing: {told(error).rstrip('.')}; install it (`pip install "
            "'bootifol[gymnasium]'` brings what Gymnasium's own classic control and MuJoCo environments need)"
        ) from error
    except TypeError as error:
        if "render_mode" in str(error):
            raise _no_pictures(name, "its constructor takes no render_mode") from error
        raise BootifolError(f"{name} cannot be made: {told(error)}") from error
    except (Exception, SystemExit) as error:  # an environment may do anything when it is made
        raise BootifolError(f"{name} cannot be made: {told(error)}") from error
    return environment


def _made_by_function(name: str) -> Environment:
    if not is_own_name(name) and name not in plugins("task"):
        raise BootifolError(
            f"'{name}' names no environment: write {PREFIX}ID, such as {PREFIX}Pendulum-v1, or MODULE:FUNCTION, "
            "such as my_package.my_module:make"
        )
    function = own_callable(name, "function", "task")
    try:
        made = function()
    except (Exception, SystemExit) as error:  # a function may do anything
        raise BootifolError(f"{name} failed: {told(error)}{where(error)}") from error
    if not isinstance(made, gymnasium.Env):
        raise BootifolError(
            f"{name} returned {type(made).__name__}, not a gymnasium.Env: return the environment itself, made with "
            'render_mode="rgb_array"'
        )
    return made


def _action_space(name: str, environment: Environment) -> gymnasium.spaces.Box:
    space = environment.action_space
    if isinstance(space, gymnasium.spaces.Dict | gymnasium.spaces.Tuple):
        raise BootifolError(
            f"{name} has {type(space).__name__} actions and {SUPPORTED}; wrap it with "
            "gymnasium.wrappers.TransformAction"
        )
    if not isinstance(space, gymnasium.spaces.Box) or not np.issubdtype(space.dtype, np.floating):
        raise BootifolError(
            f"{name} has discrete actions ({space}) and {SUPPORTED}; choose a continuous variant"
        )
    if not (np.isfinite(space.low).all() and np.isfinite(space.high).all()):
        raise BootifolError(
            f"the actions of {name} have no bounds ({space}) and {SUPPORTED}; wrap it with "
            "gymnasium.wrappers.TransformAction or give its action space finite bounds"
        )
    if not np.prod(space.shape):
        raise BootifolError(f"{name} has no actions ({space}) and {SUPPORTED}")
    return space


def _require_pictures(name: str, environment: Environment) -> None:
    modes = (environment.metadata or {}).get("render_modes") or []
    if name.startswith(PREFIX) and "rgb_array" not in modes:
        raise _no_pictures(name, f"its render modes are {', '.join(map(str, modes)) or 'none'}")
    if environment.render_mode != "rgb_array":
        raise _no_pictures(name, f"its render_mode is {environment.render_mode!r}")


def _no_pictures(name: str, found: str) -> BootifolError:
    return BootifolError(
        f"{name} renders no pictures ({found}): bootifol sees what render() returns with "
        'render_mode="rgb_array", so make the environment support that mode and with it'
    )


def _prepare_rendering() -> None:
    """Lets renderers work without a display, unless the user chose otherwise; pygame prints nothing."""
    prepare_opengl()
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    if sys.platform.startswith("linux") and not any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY"))):
        # Not "dummy", with which some environments draw nothing (highway-env).
        os.environ.setdefault("SDL_VIDEODRIVER", "offscreen")


def _close_at_exit(simulator: GymnasiumSimulator) -> None:
    """Called after a picture, so that our handler runs before those of the renderer (last in, first out)."""
    if simulator not in _open_simulators:
        _open_simulators.add(simulator)
        atexit.unregister(_close_simulators)
        atexit.register(_close_simulators)


def _close_simulators() -> None:
    for simulator in list(_open_simulators):
        simulator.close()
