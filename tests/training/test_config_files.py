"""`--config`: files that people write, what `--print-config` prints, and runs' own `config.json`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tiny_runs import ENDS_SOON

from bootifol.cli.main import main
from bootifol.errors import BootifolError
from bootifol.files import read_arrays
from bootifol.presets import PRESETS
from bootifol.training.config import TrainingConfig
from bootifol.training.config_files import ConfigFile, config_text, read_config_file
from bootifol.training.overrides import overridden
from bootifol.training.run_config import RunConfig


def written(directory: Path, text: str, name: str = "run.yaml") -> Path:
    path = directory / name
    path.write_text(text)
    return path


def test_a_partial_file_says_what_it_says(tmp_path: Path) -> None:
    text = """
    # a comment
    task: reacher_hard
    time_budget: 90m
    threads: 2
    agent: {batch_size: 64, learning_rate: 3e-4}
    reward.bootifol.references: 4
    """
    file = read_config_file(written(tmp_path, text))
    assert (file.task, file.time_budget, file.method, file.seed) == ("reacher_hard", "90m", None, None)
    config = overridden(PRESETS["cpu"], file.fields)
    assert (config.threads, config.agent.batch_size, config.agent.learning_rate) == (2, 64, 3e-4)
    assert config.reward.bootifol.references == 4


@pytest.mark.parametrize("preset", PRESETS)
def test_what_is_printed_is_read_back(tmp_path: Path, preset: str) -> None:
    training = PRESETS[preset]  # type: ignore[index]
    text = config_text(
        training,
        task=None,
        method="virl",
        preset=preset,
        seed=3,
        time_budget=None,
        demos="demos/mine",
        out=None,
    )
    file = read_config_file(written(tmp_path, text))
    assert file == ConfigFile(None, "virl", preset, 3, None, "demos/mine", None, file.fields)
    assert overridden(TrainingConfig(), file.fields) == training


def test_a_runs_configuration_says_everything(tmp_path: Path) -> None:
    run = RunConfig("drawn_reach", "gaifo", "smoke", 7, "demos", 90.5, ENDS_SOON)
    run.write(tmp_path, ["bootifol", "train"])
    file = read_config_file(tmp_path / "config.json")
    said = (file.task, file.method, file.preset, file.seed, file.time_budget, file.demos)
    assert said == ("drawn_reach", "gaifo", "smoke", 7, "90.5s", "demos")
    assert overridden(PRESETS["cpu"], file.fields) == ENDS_SOON


def test_a_runs_configuration_trains_the_same_policy(tmp_path: Path, finished: Path, demos: Path) -> None:
    again = tmp_path / "again"
    words = ["--config", str(finished / "config.json"), "--demos", str(demos), "--out", str(again)]
    assert main(["train", *words]) == 0
    then, now = (json.loads((run / "config.json").read_text()) for run in (finished, again))
    for name in ("task", "method", "preset", "seed", "time_budget", "config"):
        assert then[name] == now[name]
    first, second = (read_arrays(run / "policy.safetensors", "") for run in (finished, again))
    assert first.keys() == second.keys()
    assert all((first[name] == second[name]).all() for name in first)


def test_a_field_that_a_run_did_not_have_yet_is_what_it_is_for_who_resumes_it(tmp_path: Path) -> None:
    """Not the preset's: that one has it on since."""
    RunConfig("drawn_reach", "bootifol", "cpu", 1, "demos", None, PRESETS["cpu"]).write(tmp_path, [])
    path = tmp_path / "config.json"
    data = json.loads(path.read_text())
    del data["config"]["agent"]["ema_decay"]
    path.write_text(json.dumps(data))
    again = read_config_file(path).configured(PRESETS["cpu"], str(path))
    assert again == RunConfig.read(tmp_path).training
    assert again.agent.ema_decay == 0.0 != PRESETS["cpu"].agent.ema_decay


def test_a_file_of_before_trackers_is_read(tmp_path: Path) -> None:
    fields = asdict(ENDS_SOON) | {"tensorboard": True}
    del fields["tracker"]
    text = json.dumps({"format": 1, "task": "drawn_reach", "config": fields})
    file = read_config_file(written(tmp_path, text, "config.json"))
    assert overridden(ENDS_SOON, file.fields).tracker == "tensorboard"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "holds None and no configuration"),
        ("[1, 2]", "holds .* and no configuration"),
        ("agent: [", "cannot be read: .*line 1"),
        ("agent: !!python/object/apply:os.system [ls]", "cannot be read: could not determine a constructor"),
        ("\x00", "cannot be read"),
        ("seed: 1\nseed: 2", "cannot be read: seed stands there twice"),
        ("agent: {n_step: 1, n_step: 2}", "cannot be read: n_step stands there twice"),
        ("[" * 5000, "nested too deeply"),
        ("sead: 3", "there is no field 'sead'; the nearest is seed"),
        ("demonstration: {fraction: 0}", "there is no field 'demonstration'; the nearest is demonstrations"),
        ("seed: one", "seed must be a whole number, not 'one'"),
        ("time_budget: soon", "time_budget: 'soon' is not a duration"),
        ("format: 9", "is of format 9, and this version reads 1"),
        ("config: 3", "config holds the fields of a run and cannot be 3"),
        ("config: {threads: 1}\nthreads: 2", "threads stands both in config and beside it"),
        ("config: {tensorboard: maybe}", "tensorboard must be true or false, not 'maybe'"),
    ],
)
def test_a_bad_file_is_a_sentence_with_its_name(tmp_path: Path, text: str, sentence: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(BootifolError, match=sentence) as raised:
        read_config_file(path)
    assert str(path) in str(raised.value) and "\n" not in str(raised.value)


def test_a_file_that_is_none_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match=r"there is no .*missing\.yaml"):
        read_config_file(tmp_path / "missing.yaml")
    with pytest.raises(BootifolError, match="is no file"):
        read_config_file(tmp_path)
    (tmp_path / "large.yaml").write_text("#" * 1_000_001)
    with pytest.raises(BootifolError, match="1,000,001 bytes, more than any configuration"):
        read_config_file(tmp_path / "large.yaml")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
    max_leaves=4,
)
NAMES = st.sampled_from(
    ["agent", "agent.batch_size", "config", "seed", "time_budget", "threads", "format", "task"]
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(NAMES | st.text(max_size=5), VALUES, min_size=1, max_size=4))
def test_whatever_a_file_says_is_read_or_refused(tmp_path: Path, data: dict[str, object]) -> None:
    path = written(tmp_path, yaml.safe_dump(data))
    try:
        overridden(ENDS_SOON, read_config_file(path).fields, str(path))
    except BootifolError as error:
        assert str(path) in str(error)


def test_a_seed_may_be_as_large_as_a_runs(tmp_path: Path) -> None:
    assert read_config_file(written(tmp_path, f"seed: {2**63 - 1}")).seed == 2**63 - 1
    with pytest.raises(BootifolError, match="seed must be at least 0, not -1"):
        read_config_file(written(tmp_path, "seed: -1"))
