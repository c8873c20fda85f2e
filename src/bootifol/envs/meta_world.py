"""Meta-World 3 tasks, filmed with a camera of our own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bootifol.envs.camera import Camera, load_mujoco, load_simulator
from bootifol.envs.pictures import PictureConfig
from bootifol.types import Action, Frame

CAMERA = "corner4"
"""Looks over the table from a corner, near enough that a button is some pixels wide at 64x64. The paper's release
took Meta-World's camera of the time, corner2: the same direction from about 1.6 times as far. Work that learns
Meta-World from pixels commonly moves corner2 to where corner4 now is."""


class MetaWorldSimulator:
    """A task of Meta-World 3, whose objects or goal lie elsewhere in every episode.

    Args:
        name: such as "button-press-v3".
        pictures: size and render profile.

    Raises:
        BootifolError: Meta-World is not installed, or OpenGL is missing, so nothing can be rendered.
    """

    action_dim = 4

    def __init__(self, name: str, pictures: PictureConfig) -> None:
        self.name = name
        mujoco = load_mujoco()
        environments = load_meta_world("env_dict").ALL_V3_ENVIRONMENTS_GOAL_OBSERVABLE
        # With a seed, Meta-World puts numpy's global random state back; without one, it draws from it.
        self.environment: Any = environments[f"{name}-goal-observable"](seed=0)
        # Our time limit is the only one: past its own, Meta-World would raise.
        self.environment.max_path_length = math.inf
        self.step_seconds = float(self.environment.dt)
        self._forward = mujoco.mj_forward
        self.observation: NDArray[np.float64] = np.zeros(39)
        """What Meta-World shows its own scripted policies, `[39]`: 0:3 the hand, 4:7 the object, 36:39 the goal, in
        meters."""
        model = self.environment.model
        camera = model.camera(CAMERA)
        # Meta-World's corner cameras hang upside down: half a turn about the line of sight.
        upright = np.empty(4)
        mujoco.mju_mulQuat(upright, camera.quat, np.array([0.0, 0.0, 0.0, 1.0]))
        camera.quat = upright
        self._camera = Camera(model, pictures.picture_size, pictures.profile, camera.id)

    def reset(self, seed: int) -> None:
        # The start is what Meta-World's `set_task` would unpickle, drawn here; its own generators are never asked.
        starts = self.environment._random_reset_space
        self.environment._last_rand_vec = np.random.default_rng(seed).uniform(starts.low, starts.high)
        self.observation, _ = self.environment.reset()
        # Plate Slide moves the mark of its goal after the last computation of where things are.
        self._forward(self.environment.model, self.environment.data)

    def step(self, action: Action) -> tuple[float, bool, bool | None]:
        self.observation, reward, _, _, info = self.environment.step(np.asarray(action, np.float32))
        return float(reward), False, bool(info["success"])

    def render(self) -> Frame:
        return self._camera.picture(self.environment.data)

    def close(self) -> None:
        self._camera.close()


def load_meta_world(module: str) -> Any:
    """The module `metaworld.<module>`.

    Raises:
        BootifolError: Meta-World is not installed, or MuJoCo cannot load its OpenGL platform.
    """
    return load_simulator(f"metaworld.{module}", "metaworld")
