"""Acts with a trained policy, one picture in and one action out: python examples/run_a_policy.py RUN."""

from __future__ import annotations

import sys

import bootifol
from bootifol.tasks import make_environment


def play(run: str, seed: int = 0) -> float:
    """The return of one episode of 60 agent steps in the task that a run learned."""
    policy = bootifol.load_policy(run)
    config = policy.config
    print(
        f"{config.task}, after {config.agent_steps} agent steps: {config.frames_per_second:g} actions a second"
    )

    # Any environment will do that shows the same scene at the same rate; this one repeats actions by itself.
    environment = make_environment(config.task, config.pictures, 60, config.action_repeat)
    _, info = environment.reset(seed=seed)
    policy.reset()
    total, over = 0.0, False
    while not over:
        action = policy.act(info["frame"])
        _, reward, terminated, truncated, info = environment.step(action)
        total, over = total + reward, terminated or truncated
    environment.close()
    return total


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    print(f"return {play(sys.argv[1]):.1f}")
