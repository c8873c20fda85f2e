"""What `train` makes of its flags, before and after anything is trained."""

from __future__ import annotations

from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bootifol import api
from bootifol.cli.help_texts import field_texts
from bootifol.cli.main import main
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.presets import CPU, SMOKE
from bootifol.rewards.gaifo.config import GaifoConfig
from bootifol.training.overrides import field_kinds

EIGHT = PictureConfig(agent_size=8, video_size=8)


@dataclass
class Trainings:
    """Stands for what trains; keeps what it was called with."""

    finished: bool = True
    called: dict[str, Any] | None = None

    def train(self, task: str, demos: Path, out: Path, **named: Any) -> api.TrainedRun:
        self.called = {"task": task, "demos": demos, "out": out, **named}
        return api.TrainedRun(out, self.finished)

    def resume(self, directory: Path) -> bool:
        self.called = {"resumed": directory}
        return self.finished


@pytest.fixture
def trainings(monkeypatch: pytest.MonkeyPatch) -> Trainings:
    trainings = Trainings()
    monkeypatch.setattr(api, "train", trainings.train)
    monkeypatch.setattr(api, "resume", trainings.resume)
    return trainings


def imported(directory: Path) -> None:
    directory.mkdir(parents=True)
    np.save(directory / "film.npy", np.zeros((9, 20, 20, 3), np.uint8))
    import_videos([directory / "film.npy"], directory / "expert", Conversion(frames=9, size=8))


def test_the_task_is_what_recorded_videos_show(
    tmp_path: Path, trainings: Trainings, capsys: pytest.CaptureFixture[str]
) -> None:
    record("drawn_home", "expert", 1, tmp_path / "demos" / "expert", EIGHT)
    words = ["train", "--demos", str(tmp_path / "demos"), "--out", str(tmp_path / "run")]
    assert main(words) == 0
    assert trainings.called is not None
    assert (trainings.called["task"], trainings.called["command"]) == ("drawn_home", ["bootifol", *words])
    assert f"--task drawn_home: what the videos in {tmp_path / 'demos'} show" in capsys.readouterr().err
    assert main([*words, "--task", "drawn_reach"]) == 0
    assert trainings.called["task"] == "drawn_reach", "what was typed goes before"


def test_imported_videos_do_not_know_their_task_until_random_ones_are_recorded_beside_them(
    tmp_path: Path, trainings: Trainings, capsys: pytest.CaptureFixture[str]
) -> None:
    demos = tmp_path / "mine"
    imported(demos)
    words = ["train", "--demos", str(demos), "--out", str(tmp_path / "run")]
    assert main(words) == 2
    assert f"the videos in {demos} were imported, so nothing says what they show: add --task NAME" in (
        capsys.readouterr().err
    )
    record("drawn_home", "random", 1, demos / "random", EIGHT)
    assert main(words) == 0
    assert trainings.called is not None and trainings.called["task"] == "drawn_home"
    record("drawn_reach", "half_good", 1, demos / "half_good", EIGHT)
    assert main(words) == 2
    assert "show more than one task: add --task NAME" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "ignored"),
    [
        (
            ["--seed", "2", "--resume", "run", "--interactive.agent-steps=9"],
            "--seed, --interactive.agent-steps",
        ),
        (["--resume=run", "--preset", "cpu"], "--preset"),
        (["--out", "other", "--resume", "run"], "--out"),
    ],
)
def test_resume_refuses_what_it_would_ignore(
    words: list[str], ignored: str, trainings: Trainings, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["train", *words]) == 2
    assert f"would ignore {ignored}: leave out all but --resume" in capsys.readouterr().err
    assert trainings.called is None


@pytest.mark.parametrize(("finished", "code"), [(True, 0), (False, 130)])
def test_an_interrupted_training_ends_with_130(trainings: Trainings, finished: bool, code: int) -> None:
    trainings.finished = finished
    assert main(["train", "--resume", "run"]) == code
    assert main(["train", "--task", "drawn_home", "--demos", "demos", "--out", "run"]) == code


def test_what_was_typed_is_no_flag(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["train", "--help-all"])
    assert "--words" not in capsys.readouterr().out


CONFIG = """
task: drawn_reach
method: virl
preset: smoke
seed: 5
time_budget: 2m
agent: {batch_size: 9, n_step: 2}
"""


def test_a_file_configures_and_what_is_typed_goes_before_it(tmp_path: Path, trainings: Trainings) -> None:
    file = tmp_path / "run.yaml"
    file.write_text(CONFIG)
    words = ["train", "--config", str(file), "--demos", "demos", "--out", "run"]
    assert main(words) == 0
    assert trainings.called is not None
    told = {name: trainings.called[name] for name in ("task", "method", "preset", "seed", "time_budget")}
    assert told == {"task": "drawn_reach", "method": "virl", "preset": "smoke", "seed": 5, "time_budget": 120}
    config = trainings.called["config"]
    assert config == replace(SMOKE, agent=replace(SMOKE.agent, batch_size=9, n_step=2))
    typed = [
        "--method=gaifo",
        "--seed",
        "6",
        "--agent.n-step",
        "4",
        "--time-budget",
        "None",
        "--preset",
        "cpu",
    ]
    assert main([*words, *typed]) == 0
    told = {name: trainings.called[name] for name in ("task", "method", "preset", "seed", "time_budget")}
    assert told == {"task": "drawn_reach", "method": "gaifo", "preset": "cpu", "seed": 6, "time_budget": None}
    assert trainings.called["config"] == replace(CPU, agent=replace(CPU.agent, batch_size=9, n_step=4))


def test_a_file_may_say_where_videos_and_run_are(tmp_path: Path, trainings: Trainings) -> None:
    file = tmp_path / "run.yaml"
    file.write_text(f"{CONFIG}\ndemos: demos/mine\nout: runs/mine")
    assert main(["train", "--config", str(file)]) == 0
    assert trainings.called is not None
    assert (trainings.called["demos"], trainings.called["out"]) == (Path("demos/mine"), Path("runs/mine"))
    assert main(["train", "--config", str(file), "--out", "runs/other"]) == 0
    assert trainings.called["out"] == Path("runs/other")


def test_the_printed_configuration_is_the_same_one_read_back(
    tmp_path: Path, trainings: Trainings, capsys: pytest.CaptureFixture[str]
) -> None:
    file, again = tmp_path / "run.yaml", tmp_path / "again.yaml"
    file.write_text(CONFIG)
    assert main(["train", "--config", str(file), "--agent.n-step", "4", "--print-config"]) == 0
    again.write_text(capsys.readouterr().out)
    assert trainings.called is None, "nothing is trained"
    assert main(["train", "--config", str(again), "--print-config"]) == 0
    assert capsys.readouterr().out == again.read_text()
    assert main(["train", "--config", str(again), "--demos", "demos", "--out", "run"]) == 0
    assert trainings.called is not None
    assert trainings.called["config"].agent.n_step == 4 and trainings.called["time_budget"] == 120


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("agent: {batchsize: 3}", "there is no field 'agent.batchsize'; the nearest is agent.batch_size"),
        ("agent: {batch_size: -3}", "agent.batch_size must be at least 1, not -3"),
        ("preset: gpu", "there is no preset 'gpu'"),
        ("task: my_robot:make", "names the task 'my_robot:make', which is code of its author's"),
        (
            "task: drawn_reach\nmethod: mine:Mine",
            "names the method 'mine:Mine', which is code of its author's",
        ),
    ],
)
def test_a_file_that_cannot_be_used_is_named(
    tmp_path: Path, trainings: Trainings, capsys: pytest.CaptureFixture[str], text: str, sentence: str
) -> None:
    file = tmp_path / "run.yaml"
    file.write_text(text)
    assert main(["train", "--config", str(file), "--demos", "demos", "--out", "run"]) == 2
    said = capsys.readouterr().err
    assert str(file) in said and sentence in said
    assert trainings.called is None


def test_a_preset_that_would_change_nothing_is_refused(
    tmp_path: Path, trainings: Trainings, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["train", "--preset", "smoke", "--print-config"]) == 0
    whole = tmp_path / "whole.yaml"
    whole.write_text(capsys.readouterr().out)
    words = ["train", "--config", str(whole), "--task", "drawn_reach", "--demos", "demos", "--out", "run"]
    assert main([*words, "--preset", "cpu"]) == 2
    assert "says every field, so --preset cpu would change none" in capsys.readouterr().err
    assert main([*words, "--preset", "smoke"]) == 0


def test_code_that_a_file_names_may_be_typed_or_trusted(tmp_path: Path, trainings: Trainings) -> None:
    file = tmp_path / "run.yaml"
    file.write_text("task: my_robot:make\nmethod: mine:Mine\npreset: smoke")
    words = ["train", "--config", str(file), "--demos", "demos", "--out", "run"]
    assert main([*words, "--trust"]) == 0
    assert main([*words, "--task", "my_robot:make"]) == 2
    assert main([*words, "--task", "my_robot:make", "--method=mine:Mine"]) == 0


def test_the_short_help_fits_a_screen_and_the_whole_has_every_field(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    shown = {}
    for flag in ("--help", "--help-all"):
        with pytest.raises(SystemExit) as ended:
            main(["train", "--preset", "drawn", flag])
        assert ended.value.code == 0
        shown[flag] = capsys.readouterr().out
    common = "task demos out preset method seed threads time-budget config resume print-config trust"
    places = [shown["--help"].index(f"--{name} ") for name in common.split() if name != "threads"]
    assert places == sorted(places)
    assert "--threads INT" in shown["--help"] and "--agent.batch-size INT" not in shown["--help"]
    assert "--help-all" in shown["--help"] and len(shown["--help"].splitlines()) < 60
    for name in field_kinds():
        if "." in name and not is_dataclass(field_kinds()[name]):
            assert f"--{name.replace('_', '-')} " in shown["--help-all"]
    assert "(default: drawn)" in shown["--help"]


def test_texts_of_inherited_fields_are_found() -> None:
    texts = field_texts(GaifoConfig)
    assert texts["precision"].endswith("stay in float32.") and "\n" not in texts["precision"]
    assert texts["stacks_per_video"].startswith("Stacks drawn from each")
