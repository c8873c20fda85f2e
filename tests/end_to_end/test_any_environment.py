"""From video files to a policy in somebody's own environment: no expert is bundled, and episodes may end early."""

from __future__ import annotations

import csv
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from bootifol.cli.main import main
from bootifol.demos.demo_set import DemoSet
from bootifol.training.run_config import RunConfig
from bootifol.video_files.writing import write_video

ROBOT = '''
import gymnasium
import numpy as np


class Robot(gymnasium.Env):
    """A white column that slides along a wide picture; the episode ends at the right border."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}
    observation_space = gymnasium.spaces.Dict({"place": gymnasium.spaces.Box(-1.0, 1.0, (1,))})
    action_space = gymnasium.spaces.Box(0.0, 4.0, (1,))
    render_mode = "rgb_array"

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = float(self.np_random.uniform(-0.9, -0.5))
        return {"place": np.float32([self.place])}, {}

    def step(self, action):
        self.place = float(np.clip(self.place + 0.1 * (action[0] - 2.0), -1.0, 1.0))
        ended = self.place > 0.95
        return {"place": np.float32([self.place])}, self.place, ended, False, {"is_success": ended}

    def render(self):
        picture = np.zeros((40, 64, 3), np.uint8)
        column = round(32 + 18 * self.place)
        picture[:, column - 2 : column + 2] = 255
        return picture


def make():
    return gymnasium.wrappers.TimeLimit(Robot(), 40)
'''
TASK = "robot_of_a_test:make"
LENGTHS = ["--action-repeat", "2", "--episode-steps", "15"]
SMALL_RUN = [
    *("--task", TASK, *LENGTHS, "--preset", "smoke", "--threads", "1", "--tracker", "none"),
    *("--pictures.agent-size", "32", "--pictures.video-size", "32", "--agent.encoder", "strided"),
    *("--reward.bootifol.width-divisor", "32", "--reward.bootifol.videos-per-class", "2"),
    *("--alignment.gradient-steps", "6", "--interactive.agent-steps", "150", "--evaluation.every", "75"),
    *("--agent.warm-up-steps", "60", "--agent.update-every", "10", "--agent.batch-size", "8"),
]


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's directory: an environment in a module, and video files of it."""
    home = tmp_path_factory.mktemp("any_environment")
    (home / "robot_of_a_test.py").write_text(ROBOT)
    for number in range(6):
        column = (14 + number + np.arange(31)).clip(0, 49)
        frames = np.zeros((31, 40, 64, 3), np.uint8)
        for frame, place in zip(frames, column, strict=True):
            frame[:, place - 2 : place + 2] = 255
        write_video(home / "videos" / f"{number}.mp4", frames, 20.0)
    return home


@pytest.fixture(autouse=True)
def at_home(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture(scope="module")
def run(home: Path) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        patch.setattr(sys, "path", list(sys.path))
        shape = ["--fps", "10", "--frames", "16", "--size", "32"]
        assert main(["demos", "import", "videos", "--out", "demos", *shape]) == 0
        assert main(["demos", "check", "demos", "--task", TASK, *LENGTHS]) == 0
        assert main(["train", *SMALL_RUN, "--demos", "demos", "--out", "run"]) == 0
    return home / "run"


def test_a_run_without_an_expert_leaves_everything_else(run: Path) -> None:
    names = {path.name for path in run.iterdir()}
    assert names >= {"config.json", "evaluations.csv", "ranking.csv", "showcase.safetensors", "report.html"}
    assert {path.name.partition("-")[0] for path in (run / "videos").iterdir()} == {"agent", "random"}
    rows = list(csv.DictReader((run / "evaluations.csv").open()))
    assert {row["scaled_return"] for row in rows} == {""}
    assert {row["episode_steps"] for row in rows} == {"15", "20"}, (
        "the limit of 40 steps is 20 of the agent's"
    )
    metrics = [json.loads(line) for line in (run / "metrics.jsonl").open()]
    assert any("ranking/expert_above_random" in line.get("metrics", line) for line in metrics)
    report = (run / "report.html").read_text()
    assert (
        "robot_of_a_test.make" in report
        and "episodes solved" in report
        and "Agent and random actions" in report
    )


def test_random_videos_are_recorded_with_the_runs_lengths(run: Path) -> None:
    manifest = DemoSet.open(run.parent / "demos" / "random").manifest
    assert (manifest.task, manifest.frames, manifest.action_repeat) == (TASK, 16, 2)
    assert manifest.frames_per_second == 10.0


def test_the_run_is_rebuilt_with_its_lengths(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task = RunConfig.read(run).resolved_task()
    assert (task.action_repeat, task.episode_steps, task.evaluation_steps) == (2, 15, 20)
    assert main(["evaluate", str(run), "--episodes", "2"]) == 0
    printed = capsys.readouterr().out
    assert "of 20 agent steps" in printed.replace("\n", " ") and "scaled return" not in printed
    assert main(["train", "--resume", str(run)]) == 0


def test_videos_are_scored(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", str(run), "videos/0.mp4"]) == 0
    assert "mean reward a step" in capsys.readouterr().out


def test_tasks_lists_and_measures_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tasks", TASK, "--measure", "2"]) == 0
    printed = capsys.readouterr().out
    assert "drawn_reach" not in printed
    row = next(line for line in printed.splitlines() if "Gymnasium" in line)
    assert re.split(r"\s{2,}", row.strip()) == [
        TASK,
        "Gymnasium",
        "1",
        "40",
        "40",
        "–",
        "–",
    ]
    assert [re.split(r"\s{2,}", line)[1] for line in printed.splitlines() if re.search(r"\d ± \d", line)] == [
        "random"
    ]


def test_recording_needs_no_expert_unless_asked_for_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = [
        "demos",
        "record",
        "--task",
        TASK,
        "--episodes",
        "2",
        "--video-size",
        "16",
        "--agent-size",
        "16",
    ]
    assert main([*record, "--out", str(tmp_path / "a")]) == 0
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["random"]
    assert "demos import YOUR_VIDEOS" in capsys.readouterr().out
    assert main([*record, "--out", str(tmp_path / "b"), "--behaviors", "still", "half_good"]) == 0
    assert [path.name for path in (tmp_path / "b").iterdir()] == ["still"]
    assert "half_good videos were left out" in capsys.readouterr().out
    assert main([*record, "--out", str(tmp_path / "c"), "--behaviors", "expert"]) == 2
    assert "no expert is bundled" in capsys.readouterr().err


def test_videos_of_another_speed_are_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["demos", "import", "videos", "--out", str(tmp_path), "--frames", "16", "--size", "32"]) == 0
    assert main(["demos", "check", str(tmp_path), "--task", TASK, *LENGTHS]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert f"20 pictures a second and {TASK} shows 10" in printed


def test_a_name_in_a_sentence_keeps_its_colons(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tasks", "gymnasium:robot:Reach-v0"]) == 2
    assert "gymnasium:robot:Reach-v0" in capsys.readouterr().err
