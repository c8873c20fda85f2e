import importlib
import os
import re
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from typing import Any

import numpy as np
import pytest
import torch

from bootifol import tasks as catalogue
from bootifol.cli import doctor as doctor_command
from bootifol.cli.main import main
from bootifol.envs import camera
from bootifol.envs.drawn import DrawnReach
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.tasks import TASKS


@pytest.fixture(autouse=True)
def wide_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture
def no_learning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor_command, "milliseconds_by_threads", lambda counts: {1: (50.0, 300.0)})


@pytest.mark.usefixtures("requires_rendering", "no_learning")
def test_doctor_shows_versions_machine_and_render_profiles(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor_command, "_SIMULATORS", {"dm-control": "reacher_hard"})
    monkeypatch.setattr(doctor_command, "_STEPS", 2)
    assert main(["doctor"]) == 0
    printed = capsys.readouterr().out
    for package in ("torch", "mujoco", "dm-control", "gymnasium", "numpy"):
        assert any(package in line and metadata.version(package) in line for line in printed.splitlines())
    for word in (
        "cores",
        "memory",
        "device auto means",
        "bf16 against fp32",
        "ms an update of the agent",
        "ms a gradient step of the reward",
        "one run on this machine: --threads 1",
        "fast",
        "balanced",
        "full",
        "ms an agent step",
    ):
        assert word in printed
    assert "missing" not in printed


@pytest.mark.parametrize(
    ("there", "said"),
    [(False, "cpu"), (True, "cuda, Some GPU; not tried yet: --device cpu computes as ever")],
)
def test_doctor_says_where_training_would_compute(
    monkeypatch: pytest.MonkeyPatch, there: bool, said: str
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: there)
    monkeypatch.setattr("torch.cuda.get_device_name", lambda: "Some GPU")
    monkeypatch.setattr(doctor_command, "bf16_speed", lambda: 1.0)
    assert dict(doctor_command.machine())["device auto means"] == said


@pytest.mark.parametrize(("cores", "tried"), [(1, [1]), (2, [1, 2]), (6, [1, 2, 4, 6]), (8, [1, 2, 4, 8])])
def test_doctor_tries_powers_of_two_and_all_cores(cores: int, tried: list[int]) -> None:
    assert doctor_command.thread_counts(cores) == tried


def test_doctor_times_learning_and_leaves_the_threads_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = iter([0.5, 3.0, 0.25, 2.0, 0.5, 1.0, 0.25, 4.0])
    threads: list[int] = []

    def timed(work: Callable[[], object], repetitions: int) -> float:
        if len(threads) < 2:  # once with each work, which must do what it is to be timed at
            assert work()
        threads.append(torch.get_num_threads())
        return next(seconds)

    monkeypatch.setattr(doctor_command, "_seconds", timed)
    before = torch.get_num_threads()
    assert doctor_command.milliseconds_by_threads([1, 2]) == {1: (500.0, 1000.0), 2: (250.0, 2000.0)}
    assert threads == [1, 1, 2, 2, 1, 1, 2, 2], "they take turns"
    assert torch.get_num_threads() == before


def test_doctor_advises_the_fewest_threads_that_are_nearly_the_quickest() -> None:
    measured = {1: (100.0, 9.0), 2: (54.0, 5.0), 4: (50.0, 1.0), 8: (80.0, 1.0)}
    assert doctor_command.advised_threads(measured) == 2
    assert doctor_command.advised_threads({1: (100.0, 9.0)}) == 1


@pytest.mark.usefixtures("requires_rendering", "no_learning")
def test_doctor_exits_with_2_and_a_sentence_when_nothing_renders(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def no_context(mujoco: Any) -> Any:
        raise RuntimeError("no display")

    monkeypatch.setattr(camera, "_context_class", no_context)
    assert main(["doctor"]) == 2
    captured = capsys.readouterr()
    assert "bf16" in captured.out, "what could be measured is shown all the same"
    assert "apt-get install libegl1 libgl1-mesa-dri" in captured.err
    assert "RuntimeError: no display" in captured.err
    assert "Traceback" not in captured.err


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL is how Linux renders without a display")
def test_doctor_without_an_egl_driver_leaves_no_traceback() -> None:
    without_driver = {"MUJOCO_GL": "egl", "__EGL_VENDOR_LIBRARY_FILENAMES": os.devnull, "COLUMNS": "200"}
    code = (
        "import sys; from bootifol.cli import doctor; from bootifol.cli.main import main; "
        "doctor.milliseconds_by_threads = lambda counts: {1: (50.0, 300.0)}; sys.exit(main(['doctor']))"
    )
    process = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **without_driver}
    )
    assert process.returncode == 2
    assert process.stderr.startswith("error: MuJoCo cannot render pictures here (MUJOCO_GL is egl;")
    assert process.stderr.count("\n") == 1


def test_doctor_names_missing_packages_and_how_to_install_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    version = metadata.version

    def without_av(name: str) -> str:
        if name == "av":
            raise metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(doctor_command.metadata, "version", without_av)
    assert main(["doctor"]) == 2
    captured = capsys.readouterr()
    needed = next(name for name in metadata.requires("bootifol") or [] if name.startswith("av"))
    assert f"pip install '{needed}'" in captured.err
    assert any("av " in line and "missing" in line for line in captured.out.splitlines())


@pytest.mark.usefixtures("no_learning")
def test_doctor_is_content_without_a_simulator_and_says_how_to_get_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    version = doctor_command._version
    simulators = ("dm-control", "metaworld", "mujoco")
    monkeypatch.setattr(
        doctor_command, "_version", lambda name: None if name in simulators else version(name)
    )
    assert main(["doctor"]) == 0
    printed = capsys.readouterr().out
    assert "Pictures of drawn_reach" in printed
    for name in ("dm-control", "metaworld"):
        assert f"{name} is not installed; its tasks need `pip install 'bootifol[{name}]'`" in printed


def test_a_simulator_that_is_not_installed_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dm_control", None)
    monkeypatch.delitem(sys.modules, "dm_control.suite", raising=False)
    with pytest.raises(
        BootifolError, match=r"needs dm_control, which is not installed.*bootifol\[dm-control\]"
    ):
        catalogue.make_environment("reacher_hard", PictureConfig(), 5)


def test_a_simulator_written_for_another_mujoco_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    suite = importlib.import_module("dm_control.suite")

    def without_a_field(*_: object, **__: object) -> None:
        raise AttributeError("'MjModel' object has no attribute 'flex_vertedge'")

    monkeypatch.setattr(suite, "load", without_a_field)
    with pytest.raises(
        BootifolError, match=r"dm_control .* and mujoco .* do not go together .*flex_vertedge"
    ):
        catalogue.make_environment("reacher_hard", PictureConfig(), 5)


def test_doctor_does_not_ask_for_what_only_developers_need() -> None:
    versions, missing = doctor_command.installed()
    assert not missing
    assert "torch" in versions
    assert "pytest" not in versions


@pytest.mark.usefixtures("no_learning")
def test_doctor_sees_a_driver_that_paints_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def drawn_black(task_name: str, pictures: Any, episode_steps: int) -> Any:
        environment = catalogue.make_environment("drawn_reach", pictures, episode_steps)
        black = np.zeros((pictures.picture_size, pictures.picture_size, 3), np.uint8)
        monkeypatch.setattr(environment.simulator, "render", lambda: black)
        return environment

    monkeypatch.setattr(doctor_command, "make_environment", drawn_black)
    assert main(["doctor"]) == 2
    assert "every pixel is the same" in capsys.readouterr().err


def test_tasks_prints_the_catalogue(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tasks"]) == 0
    printed = capsys.readouterr().out
    for task in TASKS.values():
        row = next(line for line in printed.splitlines() if task.name in line)
        cells = re.split(r"\s{2,}", row.strip())
        assert cells == [
            task.name,
            task.suite,
            str(task.action_repeat),
            str(task.episode_steps),
            str(task.evaluation_steps),
            "–" if task.expert_return is None else f"{task.expert_return:g}",
            f"{task.random_return:g}",
        ]
        assert f"{task.name}: {task.description}" in printed


def test_tasks_measures_expert_and_random_on_evaluation_episodes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def painted(self: DrawnReach) -> Any:
        raise AssertionError("nobody looks at the pictures")

    monkeypatch.setattr(DrawnReach, "render", painted)
    assert main(["tasks", "drawn_reach", "--measure", "3"]) == 0
    captured = capsys.readouterr()
    assert "drawn_home" not in captured.out
    assert "drawn_reach, expert: 3/3" in captured.err
    rows = [re.split(r"\s{2,}", line) for line in captured.out.splitlines() if re.search(r"\d ± \d", line)]
    assert [(row[1], row[2]) for row in rows] == [("expert", "3"), ("random", "3")]
    expert, random = (float(row[3].split("±")[0]) for row in rows)
    # Seeds 0, 1, 2 and evaluation length, as in the catalogue's measurement.
    assert expert == pytest.approx(TASKS["drawn_reach"].expert_return, rel=0.1)
    assert random < 10
    low, high = (float(number) for number in rows[0][4].split("…"))
    assert low <= expert <= high
    # The dot is within the target at some step of every expert episode.
    assert float(rows[0][5]) == 1.0
    assert 0.0 <= float(rows[1][5]) < 1.0


def test_tasks_refuses_a_negative_number_of_episodes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tasks", "--measure", "-1"]) == 2
    assert "--measure is a number of episodes, not -1" in capsys.readouterr().err
    assert main(["tasks", "juggling"]) == 2
    assert "there is no task 'juggling'" in capsys.readouterr().err


def test_tasks_says_how_to_import_videos_of_a_task(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["tasks", "drawn_home"]) == 0
    command = "bootifol demos import VIDEOS --fps 10 --frames 31 --out demos/drawn_home"
    assert capsys.readouterr().out.splitlines()[-1] == f"import your videos with: {command}"
    assert main(["tasks"]) == 0
    assert "import your videos" not in capsys.readouterr().out

    def no_rendering(*_: object) -> None:
        raise BootifolError("install OpenGL")

    monkeypatch.setattr(catalogue, "make_environment", no_rendering)
    assert main(["tasks", "drawn_home"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "pictures a second of drawn_home are not known here: install OpenGL"


def test_pictures_a_second_are_unknown_where_an_environment_keeps_no_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    task = TASKS["drawn_home"]
    assert catalogue.frames_per_second(task) == 10
    monkeypatch.setattr(DrawnReach, "knows_time", False, raising=False)
    assert catalogue.frames_per_second(task) is None
