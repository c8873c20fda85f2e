"""Every command, end to end, on the task that needs no simulator; and what bad input gets."""

from __future__ import annotations

import base64
import csv
import html
import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bootifol.cli.main import DESCRIPTION, main
from bootifol.demos.augmentation import AugmentedVideos
from bootifol.demos.demo_set import DemoSet
from bootifol.training.checkpoint import newest_checkpoint
from bootifol.types import FrameBatch
from bootifol.video_files.writing import write_video

SMALL = ["--agent-size", "32", "--video-size", "32"]
SMALL_RUN = [
    *("--task", "drawn_reach", "--preset", "smoke", "--threads", "1", "--tracker", "none"),
    *("--pictures.agent-size", "32", "--pictures.video-size", "32", "--agent.encoder", "strided"),
    *("--reward.bootifol.width-divisor", "32", "--reward.bootifol.videos-per-class", "2"),
    *("--alignment.gradient-steps", "6", "--interactive.agent-steps", "300", "--evaluation.every", "150"),
    *("--agent.warm-up-steps", "60", "--agent.update-every", "10", "--agent.batch-size", "8"),
]


@pytest.fixture(scope="module")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("end_to_end") / "demos"
    record = ["demos", "record", "--task", "drawn_reach", "--episodes", "20", "--out", str(out), *SMALL]
    assert main(record) == 0
    return out


@pytest.fixture(scope="module")
def run(demos: Path) -> Path:
    out = demos.parent / "run"
    assert main(["train", *SMALL_RUN, "--demos", str(demos), "--out", str(out)]) == 0
    return out


def test_demos_can_be_checked(demos: Path) -> None:
    assert main(["demos", "check", str(demos), "--task", "drawn_reach"]) == 0


def test_a_run_leaves_everything_it_promises(run: Path) -> None:
    names = {path.name for path in run.iterdir()}
    assert names >= {
        *("config.json", "metrics.jsonl", "evaluations.csv", "ranking.csv", "showcase.safetensors"),
        "policy.safetensors",
        *("checkpoints", "videos", "report.html"),
    }
    rows = list(csv.DictReader((run / "evaluations.csv").open()))
    assert {row["episode_steps"] for row in rows} == {"30", "60"}
    assert max(int(row["agent_steps"]) for row in rows) == 300


def test_evaluate_prints_returns(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", str(run), "--episodes", "2"]) == 0
    printed = capsys.readouterr().out
    assert "episode 1: return" in printed and "scaled return" in printed


def test_score_rewards_video_files_and_demo_sets(
    run: Path, demos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frames = DemoSet.open(demos / "expert")[0].frames
    write_video(tmp_path / "mine.mp4", frames, 10.0)
    table, picture = tmp_path / "rewards.csv", tmp_path / "rewards.png"
    videos = [str(tmp_path / "mine.mp4"), str(demos / "half_good")]
    assert main(["score", str(run), *videos, "--out", str(table), "--picture", str(picture)]) == 0
    printed = capsys.readouterr().out
    assert "mean reward a step" in printed
    assert "of the first 6 videos" in " ".join(printed.split()) and Image.open(picture).format == "PNG"
    assert main(["score", str(run), *videos, "--picture", str(tmp_path / "rewards.jpg")]) == 2
    assert "choose a name that ends in .png" in capsys.readouterr().err
    rows = list(csv.DictReader(table.open()))
    mine = [float(row["reward"]) for row in rows if row["video"].endswith("mine.mp4")]
    assert len(mine) == 30 and np.isfinite(mine).all() and max(mine) <= 1
    assert len({row["video"] for row in rows}) == 1 + len(DemoSet.open(demos / "half_good"))


def test_report_compares_runs(run: Path, tmp_path: Path) -> None:
    """Another seed, which has come half the way of its 600 agent steps."""
    other = tmp_path / "runs" / "other"
    shutil.copytree(run, other, ignore=shutil.ignore_patterns("checkpoints"))
    config = json.loads((run / "config.json").read_text())
    config["seed"] = 2
    config["config"]["interactive"]["agent_steps"] = 600
    (other / "config.json").write_text(json.dumps(config))
    out = tmp_path / "both.html"
    assert main(["report", str(run), str(tmp_path / "runs"), "--out", str(out)]) == 0
    page = html.unescape(out.read_text())
    assert "2 runs side by side" in page
    assert f"{other} (BootIfOL on Drawn Reach) is unfinished and counts as far as it has come" in page
    assert "it has trained for 300 of 600 agent steps" in page
    assert "interactive.agent_steps (300 / 600)" in page
    pictures = re.findall(r"data:image/svg\+xml;base64,([^\"]+)", page)
    both = [
        svg for svg in map(base64.b64decode, pictures) if all(f"seed {seed}".encode() in svg for seed in "12")
    ]
    assert any(b"scaled return" in svg for svg in both) and any(b"-step episodes" in svg for svg in both)


def test_an_ended_run_can_be_resumed_without_training_again(run: Path) -> None:
    checkpoint = newest_checkpoint(run / "checkpoints")
    assert main(["train", "--resume", str(run)]) == 0
    assert newest_checkpoint(run / "checkpoints") == checkpoint


def test_the_upper_bound_runs_without_alignment(demos: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    train = ["train", *SMALL_RUN, "--method", "environment", "--demos", str(demos), "--out", str(out)]
    assert main(train) == 0
    assert not (out / "ranking.csv").exists()


def test_a_time_budget_ends_a_run(demos: Path, tmp_path: Path) -> None:
    """The steps would take hours; the budget of seconds ends it, and the schedules have run to their ends."""
    out = tmp_path / "run"
    steps = ["--interactive.agent-steps", "10000000", "--alignment.gradient-steps", "1000000"]
    train = ["train", *SMALL_RUN, *steps, "--demos", str(demos), "--out", str(out), "--time-budget", "4s"]
    assert main(train) == 0
    checkpoint = newest_checkpoint(out / "checkpoints")
    assert checkpoint is not None
    agent_steps, alignment_steps = map(int, checkpoint.name.split("-"))
    assert 0 < agent_steps < 10_000_000 and 0 < alignment_steps < 1_000_000


def test_ones_own_videos_are_enough(demos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random videos are recorded, and the reward learns from videos of varying looks, the agent's too."""
    varied = []
    sample = AugmentedVideos.sample

    def spy(self: AugmentedVideos, count: int, rng: np.random.Generator) -> FrameBatch:
        varied.append(type(self.videos).__name__)
        return sample(self, count, rng)

    monkeypatch.setattr(AugmentedVideos, "sample", spy)
    mine = tmp_path / "mine"
    videos = tmp_path / "videos"
    expert = DemoSet.open(demos / "expert")
    for index in range(4):
        write_video(videos / f"{index}.mp4", expert[index].frames, 10.0)
    imported = ["demos", "import", str(videos), "--out", str(mine), "--size", "32", "--frames", "31"]
    assert main(imported) == 0
    assert main(["train", *SMALL_RUN, "--demos", str(mine), "--out", str(tmp_path / "run")]) == 0
    assert len(DemoSet.open(mine / "random")) == 4
    assert set(varied) == {"VideoSubset", "AgentVideos"}
    updated = varied.count("AgentVideos")
    assert varied.count("VideoSubset") == 2 * 6 + updated, "expert and random, then expert and agent"
    varied.clear()
    assert main(["train", *SMALL_RUN, "--demos", str(demos), "--out", str(tmp_path / "recorded")]) == 0
    assert not varied


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["train"], "train needs --demos"),
        (["train", "--task", "fly", "--demos", "x", "--out", "y"], "there is no task 'fly'"),
        (["train", "--preset", "huge"], "there is no preset 'huge'"),
        (["train", "--demos", "nowhere", "--out", "y"], "there is no demo set at nowhere"),
        (["train", "--resume", "nowhere"], "nowhere is not a run"),
        (["train", "--demos", "x", "--out", "y", "--time-budget", "soon"], "'soon' is not a duration"),
        (
            ["train", "--agent.discount", "2", "--demos", "x", "--out", "y"],
            "agent.discount must be at most 1, not 2",
        ),
        (["evaluate", "nowhere"], "nowhere is not a run"),
        (["score", "nowhere", "video.mp4"], "nowhere is not a run"),
        (["score", "nowhere"], "there are no videos to score"),
        (["report", "nowhere"], "nowhere"),
        (["demos", "check", "nowhere"], "nowhere"),
        (["demos", "record", "--task", "fly", "--out", "y"], "there is no task 'fly'"),
        (
            ["demos", "record", "--task", "drawn_home", "--seed", "-1", "--out", "y"],
            "seed must be at least 0, not -1",
        ),
    ],
)
def test_bad_input_gets_a_sentence_and_exit_code_2(
    arguments: list[str],
    sentence: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        code = main(arguments)
    except SystemExit as stopped:  # the command line parser's own way out
        code = int(stopped.code or 0)
    printed = capsys.readouterr()
    assert code == 2
    assert sentence in " ".join((printed.err + printed.out).split())
    assert "Traceback" not in printed.err
    assert list(tmp_path.iterdir()) == [], "nothing may be left behind"


def test_an_existing_run_is_not_overwritten(
    run: Path, demos: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (run / "config.json").read_bytes()
    assert main(["train", *SMALL_RUN, "--demos", str(demos), "--out", str(run)]) == 2
    assert "holds a run already: go on with" in " ".join(capsys.readouterr().err.split())
    assert (run / "config.json").read_bytes() == before


@pytest.mark.parametrize(
    "command",
    [
        *([], ["doctor"], ["tasks"], ["train"], ["evaluate"], ["score"], ["report"]),
        *(["demos"], ["demos", "record"], ["demos", "import"], ["demos", "check"]),
    ],
    ids=" ".join,
)
def test_every_command_explains_itself(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([*command, "--help"])
    assert stopped.value.code == 0
    assert "usage: bootifol" in capsys.readouterr().out


def test_help_breaks_lines_where_the_terminal_ends_and_not_where_a_docstring_does(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    with pytest.raises(SystemExit):
        main(["experts", "train", "--help"])
    assert "shorter ones show more starts, which is what rare rewards need" in capsys.readouterr().out
    monkeypatch.setenv("COLUMNS", "120")  # one panel below the other
    for _ in range(2):  # what is joined once stays as it is
        with pytest.raises(SystemExit):
            main(["train", "--help-all"])
        printed = " ".join(capsys.readouterr().out.replace("│", " ").split())
        assert "cuda:NUMBER, or mps on a Mac. None but the CPU has been tried. (default: auto)" in printed
        assert "among those still in replay; 0 as in the paper, whose" in printed, "a setting of a setting"


@pytest.mark.parametrize(
    ("command", "usage"),
    [
        (["evaluate"], "RUN [RUN ...]"),
        (["score"], "RUN VIDEO [VIDEO ...] [--out"),
        (["report"], "RUN [RUN ...] [--out"),
        (["table"], "RUN [RUN ...] [--out"),
        (["tasks"], "[NAME ...] [--measure"),
        (["demos", "import"], "VIDEO [VIDEO ...]"),
        (["demos", "check"], "DEMOS"),
        (["demos", "export"], "DEMOS"),
    ],
    ids=lambda words: words[-1] if isinstance(words, list) else None,
)
def test_arguments_by_place_say_what_they_are(
    command: list[str], usage: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit):
        main([*command, "--help"])
    printed = capsys.readouterr().out
    assert usage in printed.splitlines()[0]
    assert "(default: )" not in printed


def test_what_training_cannot_do_without_is_required(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    with pytest.raises(SystemExit):
        main(["train", "--help"])
    printed = capsys.readouterr().out
    for flag in ("--demos PATH", "--out PATH"):
        assert "(required)" in printed.partition(flag)[2].partition(" --")[0]


def test_the_first_tour_can_be_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every line of it, but for the training, which takes minutes."""
    monkeypatch.chdir(tmp_path)
    tour = DESCRIPTION.partition("simulator:\n")[2].partition("\n\n")[0].replace("\\\n", " ")
    record, train, evaluate, report = (shlex.split(line)[1:] for line in tour.splitlines())
    record[record.index("150")] = "20"
    assert main(record) == 0
    shorter = ["--alignment.gradient-steps", "2", "--interactive.agent-steps", "60", "--tracker", "none"]
    shorter += ["--evaluation.final-episodes", "1", "--evaluation.showcase-episodes", "1"]
    assert main([*train, *shorter]) == 0
    assert main([*evaluate, "--episodes", "1"]) == 0
    assert main(report) == 0
