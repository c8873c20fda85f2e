"""Acts on what a camera sees, at the policy's own rate: python examples/robot_loop.py RUN --camera 0.

Put your robot into `send`. Before that, `--dry` prints the actions, and `--video FILE` shows the policy a recording in
place of a camera. It needs OpenCV: pip install opencv-python-headless.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

import bootifol
from bootifol.types import Action, Frame


def send(action: Action) -> None:
    """Moves the robot: float32 `[A]` in [-1, 1], where -1 and 1 are the bounds that it had in training."""
    raise SystemExit(
        f"this robot is yours to write: replace `send` in examples/robot_loop.py, or give --dry ({action})"
    )


def camera_pictures(number: int) -> Iterator[Frame]:
    """A camera's newest picture, RGB, whenever one is asked for."""
    camera = cv2.VideoCapture(number)
    camera.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # a queue of old pictures would make every action late
    if not camera.isOpened():
        raise SystemExit(f"there is no camera {number}")
    while True:
        there, picture = camera.read()
        if not there:
            raise SystemExit(f"camera {number} gives no more pictures")
        yield _rgb(picture)


def video_pictures(file: str, rate: float) -> Iterator[Frame]:
    """The pictures of a recording that show at 0, 1 / rate, 2 / rate … seconds, RGB."""
    video = cv2.VideoCapture(file)
    own_rate = video.get(cv2.CAP_PROP_FPS)
    if not video.isOpened() or own_rate <= 0:
        raise SystemExit(f"{file} is no video that OpenCV reads")
    read = shown = 0
    while True:
        there, picture = video.read()
        if not there:
            return
        read += 1
        while shown / rate < read / own_rate - 1e-6:
            yield _rgb(picture)
            shown += 1


def _rgb(picture: Any) -> Frame:
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)


@dataclass
class Pace:
    """How well the loop kept its rate."""

    actions: int = 0
    late: int = 0
    """Actions that came after the next was due."""

    worst: float = 0.0
    """Seconds that the latest one was late by."""

    def __str__(self) -> str:
        fraction = self.late / max(self.actions, 1)
        return f"{self.actions} actions, {self.late} late ({fraction:.0%}), by {1000 * self.worst:.0f} ms at worst"


def act_on(
    policy: bootifol.Policy,
    pictures: Iterator[Frame],
    act: Callable[[Action], None],
    now: Callable[[], float] = time.perf_counter,
    sleep: Callable[[float], None] = time.sleep,
) -> Pace:
    """One action a picture, at the policy's rate, until there are no more pictures or Ctrl-C.

    After a late action the next waits for its turn on the same grid of time: hurrying would show the policy a world
    that moves too slowly. Turns that were missed stay missed.

    Args:
        policy: acts.
        pictures: the newest one whenever it is asked for.
        act: gets every action.
        now: seconds.
        sleep: waits for so many of them.
    """
    period = 1.0 / policy.config.frames_per_second
    pace = Pace()
    policy.reset()
    began, turn = now(), 0
    try:
        for picture in pictures:
            act(policy.act(picture))
            pace.actions += 1
            turn += 1
            late = now() - (began + turn * period)
            if late > 0:
                pace.late += 1
                pace.worst = max(pace.worst, late)
                missed = int(late / period) + 1
                print(f"late by {1000 * late:.0f} ms: {missed} of the camera's pictures went unseen")
                turn += missed
            sleep(max(began + turn * period - now(), 0.0))
    except KeyboardInterrupt:
        pass
    return pace


def main() -> None:
    """Reads the command line and acts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("policy", help="a run, its policy.safetensors, or hf://USER/NAME")
    seen = parser.add_mutually_exclusive_group(required=True)
    seen.add_argument("--camera", type=int, help="number of the camera")
    seen.add_argument("--video", help="a recording in place of a camera")
    parser.add_argument("--dry", action="store_true", help="print actions in place of moving a robot")
    words = parser.parse_args()
    try:
        policy = bootifol.load_policy(words.policy)
    except bootifol.BootifolError as error:
        raise SystemExit(f"error: {error}") from None
    rate = policy.config.frames_per_second
    print(f"{policy.config.task}: an action every {1000 / rate:.0f} ms")
    policy.act(np.zeros((64, 64, 3), np.uint8))  # the first one is slow, and nobody waits for it yet
    pictures = camera_pictures(words.camera) if words.video is None else video_pictures(words.video, rate)
    print(act_on(policy, pictures, print if words.dry else send))


if __name__ == "__main__":
    main()
