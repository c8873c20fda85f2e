"""DeepMind Control tasks, filmed with a camera of our own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bootifol.envs.camera import Camera, load_mujoco, load_simulator, unlike_mujoco
from bootifol.envs.pictures import PictureConfig
from bootifol.types import Action, Frame

_WHOLE_TURNS = {"hopper": 1}
"""Domains whose observation holds an angle that turns without end, and where in the state it is."""


class DMControlSimulator:
    """A task of the suite.

    Args:
        domain: such as "reacher".
        task: such as "hard".
        pictures: size and render profile.

    Raises:
        BootifolError: dm-control is not installed or does not go with MuJoCo, or OpenGL is missing, so nothing can be
            rendered.
    """

    def __init__(self, domain: str, task: str, pictures: PictureConfig) -> None:
        load_mujoco()
        suite = load_simulator("dm_control.suite", "dm-control")
        # Our time limit is the only one: past its own, the suite would start the next episode unasked.
        settings = {"random": 0, "time_limit": np.inf}
        try:
            self.environment: Any = suite.load(domain, task, task_kwargs=settings)
        except (AttributeError, TypeError) as error:
            raise unlike_mujoco("dm_control", "dm-control", error) from error
        specification = self.environment.action_spec()
        self.action_dim = int(np.prod(specification.shape))
        self.step_seconds = float(self.environment.control_timestep())
        self._low, self._high = specification.minimum, specification.maximum
        self._turning = _WHOLE_TURNS.get(domain)
        # The suite's own pixels wrapper films every task with its first camera, too.
        self._camera = Camera(self.physics.model.ptr, pictures.picture_size, pictures.profile, camera=0)

    @property
    def physics(self) -> Any:
        """MuJoCo's state, for scripted experts."""
        return self.environment.physics

    def reset(self, seed: int) -> None:
        # The task's generator is all that the suite draws a start from.
        self.environment.task.random.seed(seed % 2**32)
        self.environment.reset()

    def step(self, action: Action) -> tuple[float, bool, bool | None]:
        scaled = self._low + (np.asarray(action, np.float64) + 1.0) * (self._high - self._low) / 2.0
        step = self.environment.step(scaled)
        return float(step.reward or 0.0), bool(step.last()), None

    def state(self) -> NDArray[np.float32]:
        """What the suite shows an agent that does not see: positions, velocities and the like, `[S]`.

        Cosine and sine stand for an angle that turns without end: turned over once, Hopper is where it was, and an
        expert that can rise from its back can rise from its front by rolling over.
        """
        parts = self.environment.task.get_observation(self.physics).values()
        flat: NDArray[np.float32] = np.concatenate([np.ravel(part) for part in parts]).astype(np.float32)
        if self._turning is not None:
            angle = flat[self._turning]
            flat = np.append(np.delete(flat, self._turning), [np.cos(angle), np.sin(angle)]).astype(
                np.float32
            )
        return flat

    def render(self) -> Frame:
        return self._camera.picture(self.physics.data.ptr)

    def close(self) -> None:
        self._camera.close()
