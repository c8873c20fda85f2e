"""Recording a policy of the user's in an environment of the user's."""

import sys
from pathlib import Path

import numpy as np
import pytest

from bootifol.cli.main import main
from bootifol.demos.demo_set import DemoSet

ENVIRONMENT = """
import gymnasium
import numpy as np
from gymnasium.spaces import Box


class Slide(gymnasium.Env):
    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}
    render_mode = "rgb_array"
    action_space = Box(np.float32([2.0]), np.float32([6.0]))
    observation_space = Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place = self.np_random.uniform(-0.9, 0.9)
        return np.float32([self.place]), {}

    def step(self, action):
        self.place = float(np.clip(self.place + 0.05 * (action[0] - 4.0), -1.0, 1.0))
        return np.float32([self.place]), 0.0, False, False, {}

    def render(self):
        picture = np.zeros((20, 20, 3), np.uint8)
        column = round(9 + 8 * self.place)
        picture[:, column : column + 2] = 255
        return picture


def make():
    return Slide()


def to_the_middle(observation):
    return np.clip(4.0 - 20 * observation, 2.0, 6.0)


def failing(observation):
    return 1 / 0


def shapeless(observation):
    return [4.0, 4.0]
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    Path("slide_of_a_test.py").write_text(ENVIRONMENT)
    monkeypatch.delitem(sys.modules, "slide_of_a_test", raising=False)
    return "slide_of_a_test"


def record(module: str, policy: str, *more: str) -> int:
    words = ["--task", f"{module}:make", "--episode-steps", "30", "--episodes", "2", "--agent-size", "20"]
    return main(["demos", "record", *words, "--video-size", "20", "--out", "out", "--policy", policy, *more])


def test_a_policy_acts_on_the_environments_own_observations_in_its_own_units(
    module: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert record(module, f"{module}:to_the_middle") == 0
    recorded = DemoSet.open("out/expert")
    for index in range(2):
        assert recorded[index].frames[-1, 0, 9, 0] == 255, "it came to the middle"
    assert recorded.manifest.videos[0].source["policy"] == f"{module}:to_the_middle"
    random = DemoSet.open("out/random")
    np.testing.assert_array_equal(random[1].frames[0], recorded[1].frames[0], "from the same start")
    assert "next: bootifol demos check out" in capsys.readouterr().out
    assert record(module, f"{module}:shapeless") == 2
    assert "was played by slide_of_a_test:to_the_middle" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("policy", "sentence"),
    [
        ("slide_of_a_test:failing", "division by zero (ZeroDivisionError in slide_of_a_test.py"),
        ("slide_of_a_test:shapeless", "returned [4.0, 4.0] where [1] finite numbers are an action"),
        ("slide_of_a_test:nobody", "has no function nobody"),
        ("nobody", "--policy is MODULE:FUNCTION"),
    ],
)
def test_what_cannot_act_gets_a_sentence(
    module: str, policy: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert record(module, policy) == 2
    assert sentence in " ".join(capsys.readouterr().err.split())


def test_tasks_of_the_catalogue_keep_their_experts(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--task", "drawn_home", "--out", "out", "--policy", f"{module}:to_the_middle"]
    assert main(["demos", "record", *words]) == 2
    assert "have experts of their own" in capsys.readouterr().err
    assert not Path("out").exists()
