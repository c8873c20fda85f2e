"""The lists of runs, and the command that works through them."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest
import tyro
from benchmarks.suite import main
from benchmarks.suites import SUITES, VIDEOS, PlannedRun, equivalent_steps, tasks_of, with_overrides
from fake_program import write_config, write_end

from bootifol.errors import BootifolError
from bootifol.presets import CPU, PAPER, PRESETS, SMOKE
from bootifol.training.config import TrainingConfig


def runs_of(name: str) -> list[PlannedRun]:
    return SUITES[name].runs()


@pytest.mark.parametrize("name", SUITES)
def test_runs_have_names_of_their_own_and_share_their_tasks_videos(name: str) -> None:
    runs = runs_of(name)
    assert len({run.name for run in runs}) == len(runs)
    pictures = {task: run.config.pictures for task, run in tasks_of(runs).items()}
    assert all(run.config.pictures == pictures[run.task] for run in runs)


def parsed(words: list[str], preset: TrainingConfig) -> TrainingConfig:
    """What `bootifol train` makes of the words that set fields."""
    return tyro.cli(TrainingConfig, default=preset, args=words, config=(tyro.conf.FlagConversionOff,))


@pytest.mark.parametrize("name", ["reacher", "alignment", "encoder_training", "policy_input", "smoke"])
def test_the_words_of_a_run_say_what_its_configuration_is(name: str) -> None:
    for run in runs_of(name)[: len(SUITES[name].systems(CPU, False))]:
        words = run.words(Path("demos"), Path("out"), None)
        assert words[:4] == ["--task", run.task, "--method", run.system.method]
        preset = SMOKE if run.preset == "smoke" else CPU
        assert parsed(words[words.index("--threads") :], preset) == run.config


def test_the_papers_tables_have_five_seeds_of_everything() -> None:
    runs = runs_of("paper")
    assert len(runs) == 7 * 8 * 5
    assert {run.seed for run in runs[: 7 * 8]} == {1}  # the first seed of everything comes first
    assert runs[0].config == with_overrides(PAPER, (("threads", 1),))


def test_encoder_training_lengths_are_the_papers_or_the_same_shares() -> None:
    lengths = (0, 100_000, 375_000, 1_550_000)
    assert [equivalent_steps(PAPER, length, timed=False) for length in lengths] == list(lengths)
    # 24,000 of cpu's 30,000 steps follow its warm-up: 24,000 * (100,000 - 1920) / (1,550,000 - 1920) = 1521
    assert [equivalent_steps(CPU, length, timed=False) for length in lengths] == [0, 7521, 11_784, 30_000]
    assert equivalent_steps(CPU, 375_000, timed=True) == round(30_000 * 375 / 1550)


def test_overrides_of_one_section_are_set_together() -> None:
    changed = with_overrides(
        CPU, (("reward.bootifol.reward", "cosine"), ("reward.bootifol.reward_scale", "none"))
    )
    assert (changed.reward.bootifol.reward, changed.reward.bootifol.reward_scale) == ("cosine", "none")
    with pytest.raises(BootifolError, match="reward_scale alignment is for the distance reward"):
        with_overrides(CPU, (("reward.bootifol.reward", "cosine"),))


def test_every_preset_says_how_many_videos_its_runs_want() -> None:
    assert VIDEOS.keys() == PRESETS.keys()


def test_a_suite_takes_another_preset_and_other_tasks() -> None:
    runs = SUITES["alignment"].runs("drawn", ["drawn_home"], [7])
    assert [run.name for run in runs] == [
        "drawn_home/bootifol/seed7",
        "drawn_home/bootifol-no_alignment/seed7",
        "drawn_home/bootifol-no_alignment_to_the_end/seed7",
    ]
    assert dict(runs[2].system.overrides)["interactive.reward_updates_until"] == 4500
    with pytest.raises(BootifolError, match="there is no task 'reacher_harder'"):
        SUITES["alignment"].runs(tasks=["reacher_harder"])


def test_list_prints_runs_and_runs_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / "reacher_hard" / "virl" / "seed1"
    run.mkdir(parents=True)
    write_config(run, {"task": "reacher_hard", "method": "virl"})
    write_end(run, 9.0)
    begin_nothing = functools.partial(main, program=("no such program",))
    assert (
        begin_nothing(["reacher", "--out", str(tmp_path), "--only", "*/virl/*", "*/gaifo/*", "--list"]) == 0
    )
    virl, gaifo = capsys.readouterr().out.splitlines()
    assert virl.split() == ["reacher_hard/virl/seed1", "done:", "240", "agent", "steps,", "9", "s"]
    assert gaifo.split() == ["reacher_hard/gaifo/seed1", "not", "begun"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["tables"], "there is no suite 'tables'; the suites are reacher, paper"),
        (
            ["reacher", "--only", "x"],
            "no run of the suite matches x; names are like reacher_hard/bootifol/seed1",
        ),
        (["reacher", "--workers", "0"], "--workers must be at least 1, not 0"),
        (["reacher", "--time-budget", "soon"], "'soon' is not a duration"),
    ],
)
def test_bad_input_gets_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], sentence: str
) -> None:
    assert main([*words, "--out", str(tmp_path)]) == 2
    assert sentence in capsys.readouterr().err
