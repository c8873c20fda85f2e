"""DeepMind Control tasks, rendered as cheaply as their render profile allows."""

from __future__ import annotations

import atexit
import os
import sys
from typing import Any

import numpy as np

from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.types import Action, Frame

CAMERA = 0
"""Every task of the suite is filmed with its first camera, as the suite's own pixels wrapper does."""


class DMControlSimulator:
    """A task of the suite.

    Args:
        domain: such as "reacher".
        task: such as "hard".
        pictures: size and render profile.

    Raises:
        BootifolError: OpenGL is missing, so nothing can be rendered.
    """

    def __init__(self, domain: str, task: str, pictures: PictureConfig) -> None:
        prefer_headless_rendering()
        import mujoco
        from dm_control import suite

        self.environment: Any = suite.load(domain, task, task_kwargs={"random": 0})
        self.action_dim = int(np.prod(self.environment.action_spec().shape))
        specification = self.environment.action_spec()
        self._low, self._high = specification.minimum, specification.maximum
        model = self.environment.physics.model.ptr
        size = pictures.picture_size
        model.vis.global_.offwidth = model.vis.global_.offheight = size
        if pictures.profile != "full":
            model.vis.quality.offsamples = 0
        if pictures.profile == "balanced":
            model.vis.quality.shadowsize = 512
        try:
            self._renderer = mujoco.Renderer(model, size, size)
        except Exception as error:
            raise BootifolError(no_rendering(error)) from error
        # Freed before the interpreter takes EGL apart, or it would complain at exit.
        atexit.register(self._renderer.close)
        self._scene_flags: dict[int, int] = {}
        if pictures.profile == "fast":
            flags = mujoco.mjtRndFlag
            self._scene_flags = {flags.mjRND_SHADOW: 0, flags.mjRND_REFLECTION: 0}

    @property
    def physics(self) -> Any:
        """MuJoCo's state, for scripted experts."""
        return self.environment.physics

    def reset(self, seed: int) -> None:
        # The suite draws starts from its task's generator only; it has no public way to seed it again.
        self.environment.task._random = np.random.RandomState(seed % 2**32)
        self.environment.reset()

    def step(self, action: Action) -> tuple[float, bool, bool | None]:
        scaled = self._low + (np.asarray(action, np.float64) + 1.0) * (self._high - self._low) / 2.0
        step = self.environment.step(scaled)
        # The suite's own time limit ends episodes without a termination; ours truncates them.
        return float(step.reward or 0.0), bool(step.last() and step.discount == 0.0), None

    def render(self) -> Frame:
        self._renderer.update_scene(self.physics.data.ptr, camera=CAMERA)
        for flag, value in self._scene_flags.items():
            self._renderer.scene.flags[flag] = value
        picture: Frame = self._renderer.render()
        return picture

    def close(self) -> None:
        atexit.unregister(self._renderer.close)
        self._renderer.close()


def prefer_headless_rendering() -> None:
    """On Linux without a display, MuJoCo renders through EGL unless the user chose otherwise."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")


def no_rendering(error: BaseException) -> str:
    """The sentence for a machine that cannot render."""
    return (
        f"this machine cannot render ({type(error).__name__}: {error}); on Debian or Ubuntu install Mesa with "
        "`sudo apt-get install libegl1 libgl1-mesa-dri`, then try `bootifol doctor`"
    )
