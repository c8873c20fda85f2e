"""What `train` makes of its flags, before and after anything is trained."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bootifol.cli.main import main
from bootifol.demos.import_videos import Conversion, import_videos
from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.training import api
from bootifol.training.api import TrainedRun

EIGHT = PictureConfig(agent_size=8, video_size=8)


@dataclass
class Trainings:
    """Stands for what trains; keeps what it was called with."""

    finished: bool = True
    called: dict[str, Any] | None = None

    def train_policy(self, task: str, demos: Path, out: Path, **named: Any) -> TrainedRun:
        self.called = {"task": task, "demos": demos, "out": out, **named}
        return TrainedRun(out, self.finished)

    def continue_run(self, directory: Path) -> bool:
        self.called = {"resumed": directory}
        return self.finished


@pytest.fixture
def trainings(monkeypatch: pytest.MonkeyPatch) -> Trainings:
    trainings = Trainings()
    monkeypatch.setattr(api, "train_policy", trainings.train_policy)
    monkeypatch.setattr(api, "continue_run", trainings.continue_run)
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
        main(["train", "--help"])
    assert "--words" not in capsys.readouterr().out
