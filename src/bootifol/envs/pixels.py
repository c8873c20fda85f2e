"""Any simulator as a Gymnasium environment that shows itself in pictures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import gymnasium
import numpy as np

from bootifol.envs.pictures import FrameStack, PictureConfig, resize
from bootifol.errors import BootifolError, EnvironmentFailed
from bootifol.plugins import told, where
from bootifol.types import Action, Frame, Observation


class Simulator(Protocol):
    """What a simulator must offer; everything about pictures, time and repetition is done here once.

    One that cuts episodes for reasons of its own, which are no ends to learn from, says so after a step in an attribute
    `truncated`; one that had to assume its `step_seconds` has an attribute `knows_time`, False.
    """

    action_dim: int

    step_seconds: float
    """Simulated time of one simulator step."""

    def reset(self, seed: int) -> None:
        """Draws a start from `seed` alone."""
        ...

    def step(self, action: Action) -> tuple[float, bool, bool | None]:
        """One simulator step with an action `[A]` in [-1, 1]: its reward, whether it ended, whether it succeeded."""
        ...

    def render(self) -> Frame:
        """The current state, uint8 `[P, P, 3]` where `P` is `PictureConfig.picture_size`."""
        ...

    def close(self) -> None: ...


class PixelEnvironment(gymnasium.Env[Observation, Action]):
    """A simulator behind the Gymnasium API.

    An observation is the newest `stack` frames along channels, oldest first; after `reset` the first frame is
    repeated. `info["frame"]` is the newest frame at the agent's size, `info["video_frame"]` at the reward model's.

    Args:
        simulator: what is shown.
        pictures: how it is shown.
        action_repeat: simulator steps an agent step; their rewards are summed.
        episode_steps: agent steps after which an episode is truncated.
    """

    def __init__(
        self, simulator: Simulator, pictures: PictureConfig, action_repeat: int, episode_steps: int
    ) -> None:
        self.simulator = simulator
        self.pictures = pictures
        self.action_repeat = action_repeat
        self.episode_steps = episode_steps
        self.rendered = True
        """False where nobody looks at the pictures: they are black then, and cost nothing."""
        self.knows_time: bool = getattr(simulator, "knows_time", True)
        """Whether the frames per second in `metadata` are the simulator's own."""
        self.metadata = {
            "render_modes": [],
            "render_fps": round(1.0 / (action_repeat * simulator.step_seconds), 6),
        }
        size = pictures.agent_size
        self.observation_space = gymnasium.spaces.Box(0, 255, (size, size, 3 * pictures.stack), np.uint8)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (simulator.action_dim,), np.float32)
        self._stack = FrameStack(pictures.stack)
        self._agent_steps = 0
        self._over = True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; the same seed gives the same episode in any process."""
        super().reset(seed=seed)
        with _own_errors("reset"):
            self.simulator.reset(int(self.np_random.integers(2**31)) if seed is None else seed)
        self._agent_steps, self._over = 0, False
        self._stack.start()
        info = self._look()
        return self._stack.add(info["frame"]), info

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One agent step.

        Raises:
            RuntimeError: the episode is over, or was never started.
            ValueError: the action has another shape than `[A]`, or is not finite.
            EnvironmentFailed: the simulator raised an error.
        """
        if self._over:
            raise RuntimeError("the episode is over: call reset before step")
        if np.shape(action) != self.action_space.shape or not np.isfinite(action).all():
            raise ValueError(f"an action here is {self.action_space.shape} finite numbers, not {action}")
        reward, terminated, cut, success = 0.0, False, False, None
        clipped = np.clip(action, -1.0, 1.0)
        for _ in range(self.action_repeat):
            with _own_errors("step"):
                step_reward, terminated, success = self.simulator.step(clipped)
            reward += step_reward
            cut = getattr(self.simulator, "truncated", False)
            if terminated or cut:
                break
        self._agent_steps += 1
        truncated = cut or self._agent_steps >= self.episode_steps
        self._over = terminated or truncated
        info = self._look()
        if success is not None:
            info["success"] = success
        return self._stack.add(info["frame"]), reward, terminated, truncated, info

    def close(self) -> None:
        """Frees the renderer."""
        self.simulator.close()

    def _look(self) -> dict[str, Any]:
        size = self.pictures.picture_size
        with _own_errors("render"):
            picture = self.simulator.render() if self.rendered else np.zeros((size, size, 3), np.uint8)
        return {
            "frame": resize(picture, self.pictures.agent_size),
            "video_frame": resize(picture, self.pictures.video_size),
        }


@contextmanager
def _own_errors(call: str) -> Iterator[None]:
    """Tells a simulator's own errors, which may be any, in a sentence."""
    try:
        yield
    except BootifolError as error:
        raise EnvironmentFailed(str(error)) from error
    except (Exception, SystemExit) as error:
        raise EnvironmentFailed(
            f"the environment failed in its {call}: {told(error)}{where(error)}; mend it"
        ) from error
