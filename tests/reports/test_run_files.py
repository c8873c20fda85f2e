import json
import os
from pathlib import Path

import numpy as np
import pytest
from synthetic_run import AGENT_STEPS, EXPERT_RETURN, RANDOM_RETURN

from bootifol.errors import BootifolError
from bootifol.files import read_arrays, write_arrays
from bootifol.reports.run_files import find_runs, read_run


def test_a_whole_run_is_read_without_notes(shared_run: Path) -> None:
    run = read_run(shared_run)
    assert not run.notes
    assert (run.task, run.method, run.preset, run.seed) == ("reacher_hard", "bootifol", "cpu", 1)
    assert run.agent_steps == AGENT_STEPS
    assert run.seconds == 8400
    assert run.episode_lengths() == [60, 500]
    assert list(run.evaluations_of(500))[-1] == AGENT_STEPS
    assert list(run.ranking_moments()) == [0, AGENT_STEPS]
    assert run.starts() == [0, 1, 2]
    assert len(run.video_files) == 9
    curve = run.curve("alignment", "loss/sequence")
    assert curve is not None
    assert len(curve) == 200
    assert run.curve("alignment", "episode/learned_reward") is None


def test_levels_of_the_scale_are_recovered(shared_run: Path) -> None:
    run = read_run(shared_run)
    assert run.return_levels(500) == pytest.approx((RANDOM_RETURN * 500 / 60, EXPERT_RETURN * 500 / 60))
    assert run.return_levels(60) is None
    assert read_run(shared_run).return_levels(77) is None


def test_only_the_configuration_is_needed(bare_run: Path) -> None:
    run = read_run(bare_run)
    told = " ".join(run.notes)
    for missing in ("metrics.jsonl", "evaluations.csv", "ranking.csv", "showcase.safetensors", "videos"):
        assert missing in told
    assert (run.agent_steps, run.seconds, run.starts()) == (0, None, [])


def test_a_cut_last_line_of_metrics_costs_that_line_only(run_dir: Path) -> None:
    path = run_dir / "metrics.jsonl"
    path.write_text(path.read_text()[:-40])
    run = read_run(run_dir)
    assert run.notes == ["metrics.jsonl: 1 line could not be read, as after an interrupted write."]
    curve = run.curve("interactive", "loss/sequence")
    assert curve is not None
    assert curve.steps[-1] == AGENT_STEPS - 120


def test_values_that_are_not_finite_are_left_out_and_told(run_dir: Path) -> None:
    lines = [
        {"phase": "alignment", "gradient_step": 1, "seconds": 1.0, "loss/total": 2.0},
        {"phase": "alignment", "gradient_step": 2, "seconds": 2.0, "loss/total": None},
        {"phase": "alignment", "gradient_step": 3, "seconds": 3.0, "loss/total": float("nan")},
        {"phase": "unheard of", "gradient_step": 3},
    ]
    (run_dir / "metrics.jsonl").write_text("\n".join(json.dumps(line) for line in lines))
    run = read_run(run_dir)
    curve = run.curve("alignment", "loss/total")
    assert curve is not None
    assert curve.values.tolist() == [2.0]
    assert any("2 values that are not finite" in note for note in run.notes)
    assert any("1 line could not be read" in note for note in run.notes)


def test_a_truncated_showcase_is_left_out(run_dir: Path) -> None:
    path = run_dir / "showcase.safetensors"
    path.write_bytes(path.read_bytes()[:5000])
    run = read_run(run_dir)
    assert not run.showcase
    assert any("showcase.safetensors was left out" in note for note in run.notes)


def test_an_episode_whose_reward_does_not_fit_is_left_out(run_dir: Path) -> None:
    path = run_dir / "showcase.safetensors"
    arrays = read_arrays(path, "the showcase")
    write_arrays(path, arrays | {"reward/agent/1": np.zeros(3, np.float32)})
    run = read_run(run_dir)
    assert len(run.showcase) == 8
    assert any("agent 1 was left out" in note for note in run.notes)


def test_a_command_may_be_a_list(run_dir: Path) -> None:
    header = json.loads((run_dir / "config.json").read_text())
    header["command"] = ["bootifol", "train", "--out", "my runs/x"]
    (run_dir / "config.json").write_text(json.dumps(header))
    assert read_run(run_dir).command == "bootifol train --out 'my runs/x'"


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "is missing"),
        ('{"format": 1', "cannot be read"),
        ("[]", "names no task"),
        ("{}", "names no task"),
    ],
)
def test_a_broken_configuration_is_a_sentence(run_dir: Path, content: str | None, sentence: str) -> None:
    if content is None:
        (run_dir / "config.json").unlink()
    else:
        (run_dir / "config.json").write_text(content)
    with pytest.raises(BootifolError, match=sentence):
        read_run(run_dir)


def test_no_directory_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match="there is no run directory"):
        read_run(tmp_path / "nowhere")


def test_links_in_circles_are_looked_into_once(shared_run: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    (runs / "deep").mkdir(parents=True)
    (runs / "arm-1").symlink_to(shared_run)
    for name, target in (
        ("again", runs),
        ("deep/up", runs),
        ("itself", runs / "itself"),
        ("deep/too", runs / "deep"),
    ):
        (runs / name).symlink_to(target)
    assert find_runs([runs]) == [runs / "again" / "arm-1"] or find_runs([runs]) == [runs / "arm-1"]


def test_a_pipe_in_place_of_a_file_holds_nobody_up(run_dir: Path) -> None:
    for name in ("metrics.jsonl", "evaluations.csv", "showcase.safetensors"):
        (run_dir / name).unlink()
        os.mkfifo(run_dir / name)
    run = read_run(run_dir)
    assert not run.curves and not run.evaluations and not run.showcase
    (run_dir / "config.json").unlink()
    os.mkfifo(run_dir / "config.json")
    with pytest.raises(BootifolError, match="is no file"):
        read_run(run_dir)
