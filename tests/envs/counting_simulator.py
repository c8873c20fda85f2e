import numpy as np

from bootifol.types import Action, Frame


class CountingSimulator:
    """Counts its steps: the count is the color of the picture and, in powers of 2, the reward."""

    action_dim = 2
    step_seconds = 0.05

    def __init__(self, size: int, ends_at: int | None = None) -> None:
        self.size, self.ends_at = size, ends_at
        self.count = 0
        self.renders = 0
        self.seeds: list[int] = []
        self.actions: list[Action] = []
        self.closed = False

    def reset(self, seed: int) -> None:
        self.count = 0
        self.seeds.append(seed)

    def step(self, action: Action) -> tuple[float, bool, bool | None]:
        self.count += 1
        self.actions.append(action)
        return 2.0**self.count, self.count == self.ends_at, None if self.ends_at is None else self.count == 2

    def render(self) -> Frame:
        self.renders += 1
        return np.full((self.size, self.size, 3), self.count, np.uint8)

    def close(self) -> None:
        self.closed = True
