"""Methods and tasks of installed packages: named like the library's own, and imported when they are named."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from benchmarks.page_modules import ADD_A_METHOD, write_page_modules
from tiny_runs import ENDS_SOON

import bootifol
from bootifol import plugins
from bootifol.cli.main import main
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.rewards.config import RewardConfig
from bootifol.rewards.registry import check_method, make_reward_model
from bootifol.tasks import make_environment, task_named

ENTRY_POINTS = """
[bootifol.methods]
sinkhorn = optimal_transport:OptimalTransport
missing = optimal_transport:Nothing
constant = brought_tasks:STEPS
virl = optimal_transport:OptimalTransport

[bootifol.tasks]
blink = brought_tasks:blink
odd:name = brought_tasks:blink
"""

TASKS = """
import gymnasium
import numpy as np

STEPS = 7


class Blink(gymnasium.Env):
    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}
    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    render_mode = "rgb_array"

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.light = 100
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.light = int(128 + 100 * action[0])
        return np.zeros(1, np.float32), 0.0, False, False, {}

    def render(self):
        picture = np.zeros((8, 8, 3), np.uint8)
        picture[2:6, 2:6] = self.light
        return picture


def blink():
    return gymnasium.wrappers.TimeLimit(Blink(), STEPS)
"""


def install(site: Path, package: str, entry_points: str) -> None:
    """What installing a package leaves of its name and its entry points."""
    told = site / f"{package}-1.2.dist-info"
    told.mkdir(parents=True)
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
    (told / "entry_points.txt").write_text(entry_points)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A directory of installed packages with one that brings a method and a task."""
    site = tmp_path / "site"
    install(site, "brought", ENTRY_POINTS)
    write_page_modules(ADD_A_METHOD, site)
    (site / "brought_tasks.py").write_text(TASKS)
    monkeypatch.syspath_prepend(site)
    monkeypatch.setattr(plugins, "_allowed", set())
    for module in ("optimal_transport", "brought_tasks", "variants"):  # of another test
        monkeypatch.delitem(sys.modules, module, raising=False)
    yield site
    for module in ("optimal_transport", "brought_tasks", "variants"):
        sys.modules.pop(module, None)


def test_they_are_listed_and_none_is_imported(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tasks"]) == 0
    listed = capsys.readouterr().out
    assert "--method sinkhorn: brought by brought 1.2" in listed
    assert "--task blink: brought by brought 1.2" in listed and "odd:name" not in listed
    with pytest.raises(
        BootifolError, match=r"there is no task 'blinc'; the tasks are reacher_hard.*, blink \("
    ):
        task_named("blinc")
    with pytest.raises(BootifolError, match=r"no reward method 'x'; choose one of bootifol.*, sinkhorn"):
        check_method("x")
    assert not {"optimal_transport", "brought_tasks"} & set(sys.modules)


def test_a_task_of_a_package_is_an_environment(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task = task_named("blink")
    assert (task.suite, task.episode_steps, task.has_expert) == ("Gymnasium", 7, False)
    environment = make_environment("blink", PictureConfig(agent_size=8, video_size=8), 3)
    _, info = environment.reset(seed=0)
    assert info["frame"].shape == (8, 8, 3)
    environment.close()
    assert main(["tasks", "blink"]) == 0
    assert "--fps 10 --frames 8 --out demos/blink" in capsys.readouterr().out


def test_names_of_the_library_go_before(site: Path) -> None:
    check_method("virl")
    assert "optimal_transport" not in sys.modules


def test_a_method_of_a_package_trains_and_its_run_is_trusted_like_other_code(
    site: Path, demos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"

    class Stops(bootifol.Callback):
        def on_log(self, phase: str, *_: object) -> None:
            raise bootifol.StopTraining

    trained = bootifol.train(
        "drawn_reach", demos, run, method="sinkhorn", config=ENDS_SOON, callbacks=[Stops()]
    )
    assert not trained.finished
    assert json.loads((run / "config.json").read_text())["method"] == "sinkhorn"
    monkeypatch.setattr(plugins, "_allowed", set())  # as in another process
    with pytest.raises(BootifolError, match=r"names the method 'sinkhorn', which is code .* add --trust"):
        bootifol.resume(run)
    assert not bootifol.resume(run, trust=True, callbacks=[Stops()])


@pytest.mark.parametrize(
    ("method", "sentence"),
    [
        ("missing", r"the reward method missing of brought 1\.2 cannot be imported: .*'Nothing'"),
        ("constant", r"the reward method constant of brought 1\.2 cannot be called: it is 7"),
    ],
)
def test_what_a_package_brings_wrongly_is_a_sentence(site: Path, method: str, sentence: str) -> None:
    with pytest.raises(BootifolError, match=sentence):
        check_method(method)


def test_a_name_that_two_packages_bring_is_not_guessed(site: Path) -> None:
    install(site, "other", "[bootifol.methods]\nsinkhorn = other.methods:Sinkhorn\n")
    with pytest.raises(
        BootifolError, match=r"brought 1\.2 and other 1\.2 both bring .* write optimal_transport:Opt"
    ):
        make_reward_model("sinkhorn", RewardConfig(), 32, seed=1)
    shutil.rmtree(site / "other-1.2.dist-info")
    assert type(make_reward_model("sinkhorn", RewardConfig(), 32, seed=1)).__name__ == "OptimalTransport"
