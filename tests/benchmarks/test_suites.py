"""The lists of runs, and the command that works through them."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path

import pytest
import tyro
from benchmarks.suite import main
from benchmarks.suites import (
    SUITES,
    VIDEOS,
    PlannedRun,
    demos_of,
    equivalent_steps,
    every_system,
    virl_updates_every,
    with_overrides,
)
from fake_program import write_config, write_end

from bootifol.errors import BootifolError
from bootifol.evaluation.tables import EvaluationRow, append_evaluations
from bootifol.presets import BACKBONE, CPU, DRAWN_PIXELS, PAPER, PRESETS, preset
from bootifol.reports.paper_results import RETURNS
from bootifol.reports.result_tables import result_tables
from bootifol.reports.run_files import find_runs, read_run
from bootifol.rewards.registry import METHODS
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig


def runs_of(name: str) -> list[PlannedRun]:
    return SUITES[name].runs()


@pytest.mark.parametrize("name", SUITES)
def test_runs_have_names_of_their_own_and_videos_that_suit_all_who_share_them(name: str) -> None:
    runs = runs_of(name)
    assert len({run.name for run in runs}) == len(runs)
    demos = {
        name: (run.config.pictures, run.config.episode_steps, run.preset)
        for name, run in demos_of(runs).items()
    }
    assert all(
        (run.config.pictures, run.config.episode_steps, run.preset) == demos[run.demos_name] for run in runs
    )


def parsed(words: list[str], preset: TrainingConfig) -> TrainingConfig:
    """What `bootifol train` makes of the words that set fields."""
    return tyro.cli(TrainingConfig, default=preset, args=words, config=(tyro.conf.FlagConversionOff,))


@pytest.mark.parametrize(
    "name",
    [
        "reacher",
        "drawn",
        "backbone",
        "alignment",
        "encoder_training",
        "policy_input",
        "remedies",
        "precision",
        "smoke",
    ],
)
def test_the_words_of_a_run_say_what_its_configuration_is(name: str) -> None:
    for run in [run for run in runs_of(name) if run.seed == 1]:
        words = run.words(Path("demos"), Path("out"), None)
        assert words[:6] == ["--task", run.task, "--method", run.system.method, "--preset", run.preset]
        assert parsed(words[words.index("--threads") :], preset(run.preset)) == run.config


def test_the_papers_tables_have_five_seeds_of_everything() -> None:
    runs = runs_of("paper")
    one_seed = 7 * 8 + 3  # a backbone on the three tasks of Meta-World
    assert len(runs) == one_seed * 5
    assert {run.seed for run in runs[:one_seed]} == {1}  # the first seed of everything comes first
    assert runs[0].config == with_overrides(PAPER, (("threads", 1),))


def backbones(name: str) -> list[PlannedRun]:
    """The runs of a suite that have one, of the first seed."""
    return [run for run in runs_of(name) if run.system.variant == "backbone" and run.seed == 1]


def test_a_backbone_stands_beside_the_papers_numbers() -> None:
    with_number = [task for task, agents in RETURNS.items() if "Eff-BootIfOL" in agents]
    assert [run.task for run in backbones("paper")] == with_number
    assert [run.task for run in backbones("cpu")] == with_number
    assert [run.name for run in backbones("backbone")] == ["drawer_close/bootifol-backbone/seed1"]
    assert not backbones("reacher")


def test_a_backbone_has_the_papers_preset_or_weights_that_are_there_already() -> None:
    papers, small = backbones("paper")[0], backbones("cpu")[0]
    assert (papers.preset, papers.demos_name) == ("backbone", "button_press-224")
    assert papers.config == replace(BACKBONE, threads=1)
    lite = replace(CPU.reward.bootifol, backbone="efficientnet_lite0")
    assert small.config.reward.bootifol == lite
    assert small.config.pictures == replace(CPU.pictures, video_size=224)
    alone = SUITES["backbone"].runs("backbone")
    assert [run.system.name for run in alone] == ["bootifol"], "the preset has a backbone already"


@pytest.mark.parametrize("name", ["paper", "cpu", "backbone"])
def test_a_backbone_has_the_papers_row_of_the_table(tmp_path: Path, name: str) -> None:
    from_scratch, with_backbone = (
        next(
            run
            for run in runs_of(name)
            if (run.task, run.system.method, run.system.variant) == ("drawer_close", "bootifol", variant)
        )
        for variant in ("", "backbone")
    )
    finished(from_scratch, tmp_path, 0.4)
    finished(with_backbone, tmp_path, 0.8)
    scaled = result_tables([read_run(directory) for directory in find_runs([tmp_path])]).tables[0]
    rows = [
        (row.agent, row.summary and row.summary.mean, row.paper and row.paper.scaled) for row in scaled.rows
    ]
    assert rows == [("Eff-BootIfOL", 0.8, 0.91), ("BootIfOL", 0.4, 0.53)]


def finished(run: PlannedRun, out: Path, scaled: float) -> None:
    """What tables read of a run that has ended, with one final episode."""
    directory = out / run.name
    directory.mkdir(parents=True)
    config = replace(run.config, evaluation=replace(run.config.evaluation, final_episodes=1))
    RunConfig(run.task, run.system.method, run.preset, run.seed, "demos", None, config).write(directory, [])
    steps = config.interactive.agent_steps
    end = EvaluationRow(steps, 60.0, 500, 0, 7, 1000 * scaled, scaled, None)
    append_evaluations(directory / "evaluations.csv", [end])
    (directory / "metrics.jsonl").write_text(
        f'{{"phase": "interactive", "agent_steps": {steps}, "seconds": 60.0}}\n'
    )


def test_encoder_training_lengths_are_the_papers_or_the_same_shares() -> None:
    lengths = (0, 100_000, 375_000, 1_550_000)
    assert [equivalent_steps(PAPER, length, timed=False) for length in lengths] == list(lengths)
    # 24,000 of cpu's 30,000 steps follow its warm-up: 24,000 * (100,000 - 1920) / (1,550,000 - 1920) = 1521
    assert [equivalent_steps(CPU, length, timed=False) for length in lengths] == [
        0,
        7521,
        11_784,
        30_000,
    ]
    assert equivalent_steps(CPU, 375_000, timed=True) == round(30_000 * 375 / 1550)


def test_virl_takes_twice_as_many_gradient_steps_as_bootifol_whatever_the_preset() -> None:
    assert virl_updates_every(PAPER) == 50  # N_update, with which the paper says so
    # cpu: 500 in the Alignment Phase and 9000 / 50 after it, twice that in 24,000 agent steps
    assert virl_updates_every(CPU) == round(24_000 / (2 * 680)) == 18
    # Not fewer because BootIfOL's reward rests after 6 % of learning there: 940 agent steps are the paper's 375K.
    assert virl_updates_every(DRAWN_PIXELS) == round(3900 / (2 * (150 + 940 / 50))) == 12


def test_the_learning_test_compares_every_method_and_the_tutorials() -> None:
    runs = [run for run in runs_of("drawn") if run.seed == 1]
    assert [run.system.name for run in runs] == [
        "bootifol",
        "bootifol-cosine",
        "virl",
        "gaifo",
        "context_translation-n1",
        "context_translation-n10",
        "environment",
        "random",
        "optimal_transport.OptimalTransport",
    ]
    assert {run.system.method for run in runs} == {*METHODS, "random", "optimal_transport:OptimalTransport"}


def test_a_method_of_ones_own_stands_beside_the_others() -> None:
    mine = SUITES["drawn"].runs(own=["my_package.mine:Method", "optimal_transport:OptimalTransport"])
    assert len(mine) == len(runs_of("drawn")) + 3, "the tutorial's is there already"
    name = "drawn_home/my_package.mine.Method/seed1"
    words = next(run for run in mine if run.name == name).words(Path("demos"), Path("out"), None)
    assert words[2:4] == ["--method", "my_package.mine:Method"]
    with pytest.raises(BootifolError, match="is named MODULE:NAME, not 'virl'"):
        SUITES["drawn"].runs(own=["virl"])


def test_a_remedy_is_taken_away_from_the_preset_and_cloning_only_where_there_is_some() -> None:
    drawn, cpu = (
        {run.system.variant: run for run in runs_of_remedies(name)} for name in ("drawn_pixels", "cpu")
    )
    assert cpu.keys() - drawn.keys() == {"nothing_cloned"}
    assert drawn["rewards_stored_once"].config.interactive.relabel_episodes == 0
    agent = cpu["nothing_cloned"].config.agent
    assert cpu["nothing_cloned"].config.demonstrations.share == agent.cloning_weight == 0
    assert (agent.warm_up_steps, agent.warm_up_hold) == (PAPER.agent.warm_up_steps, PAPER.agent.warm_up_hold)


def runs_of_remedies(preset_name: str) -> list[PlannedRun]:
    return SUITES["remedies"].runs(preset_name, seeds=[1])


def test_two_precisions_differ_in_the_arithmetic_of_agent_and_reward_alone() -> None:
    bf16, fp32 = (run.config for run in SUITES["precision"].runs(seeds=[1]))
    assert (bf16.agent.precision, bf16.reward.bootifol.precision) == ("bf16", "bf16")
    both = (("agent.precision", "fp32"), ("reward.bootifol.precision", "fp32"))
    assert with_overrides(bf16, both) == fp32 != bf16


def test_a_preset_that_clones_shows_what_cloning_alone_brings() -> None:
    names = {
        name: [system.name for system in every_system(preset(name), False)]
        for name in ("cpu", "drawn_pixels")
    }
    assert set(names["cpu"]) - set(names["drawn_pixels"]) == {"bootifol-cloning_alone"}
    environment = next(system for system in every_system(CPU, False) if system.method == "environment")
    assert with_overrides(CPU, environment.overrides).agent.exploration(10_000) > 0.5


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
    runs = SUITES["alignment"].runs("drawn_pixels", ["drawn_home"], [7])
    assert [run.name for run in runs] == [
        "drawn_home/bootifol-trained_24_percent/seed7",
        "drawn_home/bootifol-no_alignment/seed7",
        "drawn_home/bootifol-no_alignment_to_the_end/seed7",
    ]
    assert [run.config.interactive.reward_updates_until for run in runs] == [1540, 1540, 4500]
    assert [run.config.alignment.gradient_steps for run in runs] == [150, 0, 0]
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


def test_list_shows_the_backbone_beside_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["backbone", "--out", str(tmp_path), "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [
        "drawer_close/bootifol/seed1",
        "drawer_close/bootifol-backbone/seed1",
    ]


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
