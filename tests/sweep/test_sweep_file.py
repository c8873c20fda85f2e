"""Which runs a file names, and what is wrong with one."""

from __future__ import annotations

from pathlib import Path

import pytest
import tyro

from bootifol.errors import BootifolError
from bootifol.presets import PRESETS, preset
from bootifol.sweep.planned import RANDOM, PlannedRun, record_words
from bootifol.sweep.sweep_file import read_sweep
from bootifol.training.config import TrainingConfig


def runs_of(path: Path, text: str, trust: bool = False) -> list[PlannedRun]:
    (path / "mine.yaml").write_text(text)
    return read_sweep(path / "mine.yaml", trust)


def test_a_grid_has_every_combination_and_the_first_seed_of_all_first(tmp_path: Path) -> None:
    text = """
        tasks: [drawn_home, drawn_reach]
        methods: [bootifol, virl]
        presets: drawn_pixels
        variants:
          default:
          longer: {interactive.agent_steps: 9000}
        seeds: [3, 1]
        """
    runs = runs_of(tmp_path, text)
    assert [run.name for run in runs[:5]] == [
        "drawn_home/bootifol/seed3",
        "drawn_home/bootifol-longer/seed3",
        "drawn_home/virl/seed3",
        "drawn_home/virl-longer/seed3",
        "drawn_reach/bootifol/seed3",
    ]
    assert len(runs) == 2 * 2 * 2 * 2 and {run.seed for run in runs[:8]} == {3}
    assert {run.demos for run in runs} == {Path("demos/drawn_home"), Path("demos/drawn_reach")}
    assert runs[1].config.interactive.agent_steps == 9000


def test_several_presets_are_part_of_the_name(tmp_path: Path) -> None:
    text = "{tasks: drawn_home, presets: [drawn, smoke], variants: {default: {}, b: {checkpoint_minutes: 1}}}"
    assert [run.system for run in runs_of(tmp_path, text)] == [
        "bootifol-drawn",
        "bootifol-drawn-b",
        "bootifol-smoke",
        "bootifol-smoke-b",
    ]


def test_grids_have_keys_of_their_own_in_place_of_the_files(tmp_path: Path) -> None:
    text = """
        tasks: drawn_home
        seeds: [1, 2]
        cpus: 2
        time_budget: 60m
        grids:
          - methods: [virl, random]
          - {tasks: drawn_reach, cpus: 1, gpus: 0.5, retries: 0, demos: "videos/{task}-64", seeds: 7}
        """
    runs = runs_of(tmp_path, text)
    assert [run.name for run in runs] == [
        "drawn_home/virl/seed1",
        "drawn_home/random/seed1",
        "drawn_reach/bootifol/seed7",
        "drawn_home/virl/seed2",
        "drawn_home/random/seed2",
    ]
    assert (runs[0].cpus, runs[0].gpus, runs[0].retries, runs[0].seconds) == (2, 0.0, 3, 3600.0)
    assert (runs[2].cpus, runs[2].gpus, runs[2].retries) == (1, 0.5, 0)
    assert runs[2].demos == Path("videos/drawn_reach-64")
    assert runs[1].words(Path("out"))[0] == RANDOM


def test_words_say_what_the_configuration_is(tmp_path: Path) -> None:
    text = """
        tasks: drawn_home
        presets: drawn_pixels
        cpus: 3
        variants:
          a: {agent.cloning_weight: 1, agent.learning_rate: 1e-3, reward.bootifol.backbone: null}
          b: {reward.bootifol.backbone: efficientnet_lite0, tracker: none, interactive.agent_steps: 7000}
          c: {reward.bootifol.reward: cosine, reward.bootifol.reward_scale: none}
        """
    runs = runs_of(tmp_path, text)
    assert (runs[0].config.agent.cloning_weight, runs[0].config.agent.learning_rate) == (1.0, 1e-3)
    for run in runs:
        words = run.words(Path("out"))
        assert words[:7] == [
            "train",
            "--method",
            "bootifol",
            "--task",
            "drawn_home",
            "--preset",
            "drawn_pixels",
        ]
        fields = words[words.index("--threads") :]
        config: TrainingConfig = tyro.cli(
            TrainingConfig, default=preset(run.preset), args=fields, config=(tyro.conf.FlagConversionOff,)
        )
        assert config == run.config
        assert isinstance(run.config.agent.cloning_weight, float)


def test_a_preset_is_its_methods(tmp_path: Path) -> None:
    (run,) = runs_of(tmp_path, "{tasks: drawn_home, methods: virl, presets: drawn}")
    assert run.config.agent == PRESETS["drawn_pixels"].agent


def test_videos_are_recorded_as_the_runs_read_them(tmp_path: Path) -> None:
    (run,) = runs_of(tmp_path, "{tasks: button_press, presets: backbone}")
    words = record_words(run, ["expert"], 3)
    for option, value in (("--video-size", "224"), ("--episode-steps", "50"), ("--profile", "full")):
        assert words[words.index(option) + 1] == value


def test_code_that_a_file_names_wants_trust(tmp_path: Path) -> None:
    text = "{tasks: drawn_home, methods: 'my_package.mine:Method'}"
    with pytest.raises(
        BootifolError, match=r"mine\.yaml names the method 'my_package\.mine:Method'.*--trust"
    ):
        runs_of(tmp_path, text)
    (run,) = runs_of(tmp_path, text, trust=True)
    assert run.name == "drawn_home/my_package.mine.Method/seed1"
    assert run.words_to_resume(Path("out")) == ["train", "--resume", "out", "--trust"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "{task: drawn_home}",
            r"mine\.yaml has the key 'task', which is unknown \(is tasks meant\?\): the keys are",
        ),
        (
            "{tasks: drawn_home, grids: [{sedes: 1}]}",
            r"mine\.yaml: grid 1 has the key 'sedes'.*is seeds meant",
        ),
        ("{tasks: drawn_home, grids: [{grids: []}]}", "grid 1 has the key 'grids', which is unknown"),
        ("[drawn_home]", r"mine\.yaml holds \['drawn_home'\]; write keys and their values"),
        ("{tasks: [drawn_home", r"mine\.yaml is no YAML: "),
        ("{methods: virl}", r"mine\.yaml: no tasks are named"),
        ("{tasks: []}", r"tasks is \[\]: name one at least"),
        ("{tasks: drawn_home, seeds: [1, 1]}", "seeds is .*: name one at least, and each once"),
        ("{tasks: drawn_home, seeds: one}", "seeds holds 'one', which is not a whole number from 0 to"),
        ("{tasks: drawn_home, seeds: true}", "seeds holds True, which is not a whole number"),
        ("{tasks: drawn_home, cpus: 0}", "cpus holds 0, which is not a whole number from 1 to 1,024"),
        ("{tasks: drawn_home, gpus: -1}", "gpus holds -1, which is not a number from 0"),
        ("{tasks: drawn_home, time_budget: 60}", "time_budget holds 60, which is not a text"),
        ("{tasks: drawn_home, time_budget: soon}", r"mine\.yaml: 'soon' is not a duration"),
        ("{tasks: drawn_houm}", "there is no task 'drawn_houm'"),
        ("{tasks: drawn_home, methods: gail}", "there is no reward method 'gail'"),
        ("{tasks: drawn_home, presets: big}", "there is no preset 'big'"),
        ("{tasks: drawn_home, demos: 'demos/{method}'}", r"demos is 'demos/\{method\}': \{task\} is all"),
        ("{tasks: drawn_home, variants: [a]}", r"variants is \['a'\]: write NAME"),
        (
            "{tasks: drawn_home, variants: {a/b: {}}}",
            "a variant is named 'a/b', which is no name of a directory",
        ),
        ("{tasks: drawn_home, variants: {a: 3}}", "the variant a is 3: write"),
        (
            "{tasks: drawn_home, variants: {a: {agent: {hidden_dim: 3}}}}",
            "the variant a has 'agent': .*; write dotted",
        ),
        (
            "{tasks: drawn_home, variants: {a: {agent: 3}}}",
            "bootifol-a with the preset cpu: agent is a section and cannot be 3: name its fields",
        ),
        (
            "{tasks: drawn_home, variants: {a: {agent.size: 3}}}",
            r"there is no field 'agent\.size'; the nearest is agent\.batch_size",
        ),
        (
            "{tasks: drawn_home, variants: {a: {agent.batch_size: big}}}",
            r"must be a whole number, not 'big'",
        ),
        (
            "{tasks: drawn_home, variants: {a: {agent.batch_size: 1.5}}}",
            r"must be a whole number, not 1\.5",
        ),
        (
            "{tasks: drawn_home, variants: {a: {threads: 2}}}",
            "the variant a sets threads: those of a run are",
        ),
        (
            "{tasks: drawn_home, variants: {a: {reward.bootifol.reward: cosine}}}",
            "bootifol-a with the preset cpu: .*reward_scale alignment is for the distance reward",
        ),
        (
            "{tasks: drawn_home, time_budget: 1m, variants: {a: {alignment.time_fraction: 0.9}}}",
            "leave less than half for acting",
        ),
        (
            "{tasks: drawn_home, grids: [{seeds: 1}, {seeds: [2, 1]}]}",
            "has two runs with the name drawn_home/bootifol/seed1",
        ),
    ],
)
def test_a_file_that_cannot_be_run_gets_a_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(BootifolError, match=sentence) as error:
        runs_of(tmp_path, text)
    assert "mine.yaml" in str(error.value)


def test_a_missing_file_gets_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match=r"the sweep's file cannot be read: .*mine\.yaml"):
        read_sweep(tmp_path / "mine.yaml")
