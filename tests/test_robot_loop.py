"""The example that acts on a camera: its rate, what it counts as late, and a recording in place of a camera."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.policy import Policy, PolicyConfig, write_policy
from bootifol.envs.pictures import PictureConfig
from bootifol.video_files.writing import write_video

pytest.importorskip("cv2")

EXAMPLE = Path(__file__).parents[1] / "examples" / "robot_loop.py"
CONFIG = PolicyConfig("drawn_reach", 120, 2, 1, 10.0, PictureConfig(24, 24, 1))


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    sys.modules["robot_loop"] = type(sys)("robot_loop")  # its dataclass looks for its module
    return runpy.run_path(str(EXAMPLE), run_name="robot_loop")


class Clock:
    """Time that passes where the loop sleeps, and where the policy takes so long."""

    def __init__(self, takes: list[float]) -> None:
        self.seconds, self.takes = 100.0, takes
        self.acted: list[float] = []

    def now(self) -> float:
        return self.seconds

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0
        self.seconds += seconds

    def policy(self) -> Policy:
        def act(observation: Any) -> Any:
            self.acted.append(round(self.seconds - 100.0, 6))
            self.seconds += self.takes[len(self.acted) - 1]
            return np.zeros(2, np.float32)

        return Policy(act, CONFIG)


def pictures(count: int) -> Iterator[np.ndarray]:
    return iter([np.full((24, 24, 3), number, np.uint8) for number in range(count)])


def test_it_keeps_its_rate_and_counts_what_is_late(example: dict[str, Any], capsys: Any) -> None:
    clock = Clock([0.03, 0.0, 0.25, 0.05, 0.12, 0.0])
    sent: list[Any] = []
    pace = example["act_on"](clock.policy(), pictures(6), sent.append, clock.now, clock.sleep)

    # Due every 0.1 s; the third action ends at 0.45, 0.15 s after the fourth was due; the next turn is at 0.5.
    assert clock.acted == [0.0, 0.1, 0.2, 0.5, 0.6, 0.8]
    assert (pace.actions, pace.late, len(sent)) == (6, 2, 6)
    assert pace.worst == pytest.approx(0.15)
    assert str(pace) == "6 actions, 2 late (33%), by 150 ms at worst"
    assert capsys.readouterr().out.splitlines() == [
        "late by 150 ms: 2 of the camera's pictures went unseen",
        "late by 20 ms: 1 of the camera's pictures went unseen",
    ]


def test_ctrl_c_ends_it_with_its_count(example: dict[str, Any]) -> None:
    def interrupt(action: Any) -> None:
        raise KeyboardInterrupt

    clock = Clock([0.0])
    assert example["act_on"](clock.policy(), pictures(3), interrupt, clock.now, clock.sleep).actions == 0


@pytest.mark.parametrize(
    ("own_rate", "rate", "seen"), [(20.0, 10.0, [0, 2, 4, 6, 8]), (5.0, 10.0, [0, 0, 1, 1])]
)
def test_a_recording_is_seen_at_the_policys_rate(
    example: dict[str, Any], tmp_path: Path, own_rate: float, rate: float, seen: list[int]
) -> None:
    count = max(seen) + (2 if own_rate > rate else 1)
    frames = np.stack([np.full((64, 64, 3), (20 * number, 0, 250), np.uint8) for number in range(count)])
    write_video(tmp_path / "v.mp4", frames, own_rate)
    shown = list(example["video_pictures"](str(tmp_path / "v.mp4"), rate))
    assert [round(int(picture[32, 32, 0]) / 20) for picture in shown] == seen
    assert all(picture[32, 32, 2] > 200 for picture in shown), "red, green, blue: not the order of OpenCV"


def test_it_prints_a_policys_actions_on_a_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    agent = DrQv2(DrQv2Config(encoder="strided", feature_dim=8, hidden_dim=16), 24, 1, 2, seed=3)
    write_policy(tmp_path / "policy.safetensors", CONFIG, agent)
    write_video(tmp_path / "v.mp4", np.zeros((3, 48, 48, 3), np.uint8), 10.0)
    words = [str(tmp_path / "policy.safetensors"), "--video", str(tmp_path / "v.mp4")]

    monkeypatch.setattr(sys, "argv", ["robot_loop.py", *words, "--dry"])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "drawn_reach: an action every 100 ms"
    assert sum(line.startswith("[") for line in lines) == 3
    assert lines[-1].startswith("3 actions, ")

    monkeypatch.setattr(sys, "argv", ["robot_loop.py", *words])
    with pytest.raises(SystemExit, match="this robot is yours to write"):
        runpy.run_path(str(EXAMPLE), run_name="__main__")
    monkeypatch.setattr(sys, "argv", ["robot_loop.py", str(tmp_path / "gone"), "--dry", "--video", "v.mp4"])
    with pytest.raises(SystemExit, match=r"error: .*gone"):
        runpy.run_path(str(EXAMPLE), run_name="__main__")
