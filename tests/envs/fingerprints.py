"""Prints a checksum of some episodes; run as a script, it does so in a process of its own."""

import hashlib
import sys

from bootifol.envs.pictures import PictureConfig
from bootifol.envs.rollout import play_episode
from bootifol.experts import make_behavior
from bootifol.tasks import TASKS, make_environment


def fingerprints(another_episode_first: bool) -> list[str]:
    """One line an episode of every task; environments are left open on purpose."""
    lines = []
    for task in sorted(TASKS):
        environment = make_environment(task, PictureConfig(agent_size=24, video_size=16), 6)
        if another_episode_first:
            play_episode(environment, make_behavior("random", task, environment, 8), 8, "another")
        for seed in (2**31 - 1, 0):
            who = "half_good" if TASKS[task].has_expert else "random"
            act = make_behavior(who, task, environment, seed)
            played = play_episode(environment, act, seed, "episode")
            episode = played.episode
            parts = (episode.frames.tobytes(), episode.video.frames.tobytes(), episode.actions.tobytes())
            lines.append(
                f"{task} {seed} {hashlib.sha256(b''.join(parts)).hexdigest()} {played.environment_return!r}"
            )
    return lines


if __name__ == "__main__":
    sys.stdout.write("\n".join(fingerprints(another_episode_first=True)))
