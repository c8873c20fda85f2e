import json
from dataclasses import replace
from pathlib import Path

import pytest
from synthetic_run import AGENT_STEPS, write_synthetic_run

from bootifol.reports.final_return import final_return
from bootifol.reports.findings import findings, number
from bootifol.reports.run_files import read_run


def test_the_long_episodes_speak_for_a_run(shared_run: Path) -> None:
    final = final_return(read_run(shared_run))
    assert final is not None
    assert (final.agent_steps, final.episode_steps, final.successes) == (AGENT_STEPS, 500, 10)
    assert final.scaled_return is not None
    assert final.scaled_return.mean == pytest.approx(0.93, abs=0.1)


def test_a_good_run_is_told_so(shared_run: Path) -> None:
    told = findings(read_run(shared_run))
    assert [finding.verdict for finding in told] == ["good"] * 4
    assert "its true return rose with it" in told[2].text


def test_where_the_policy_was_cloned_the_reward_gets_no_credit(tmp_path: Path) -> None:
    directory = write_synthetic_run(tmp_path / "cloned")
    with (directory / "metrics.jsonl").open("a") as file:
        for step in (10, 20):
            record = {"phase": "cloning", "gradient_step": step, "seconds": 1.0, "agent/cloning_loss": 0.1}
            file.write(json.dumps(record) + "\n")
    following = findings(read_run(directory))[2]
    assert following.verdict == "fair"
    assert "clone of the videos" in following.text


def test_a_run_that_learned_nothing_is_told_so(tmp_path: Path) -> None:
    run = read_run(write_synthetic_run(tmp_path / "idle", final=0.0))
    policy, _, following, showcase = findings(run)
    assert (policy.verdict, following.verdict, showcase.verdict) == ("poor", "poor", "poor")


def test_without_an_expert_the_policy_stands_beside_random_actions(shared_run: Path) -> None:
    run = read_run(shared_run)
    showcase = {key: video for key, video in run.showcase.items() if key[0] != "expert"}
    unscaled = [replace(row, scaled_return=None) for row in run.evaluations]
    solved = findings(replace(run, evaluations=unscaled, showcase=showcase))[0]
    assert solved.verdict == "good"
    assert "where random actions return" in solved.text and "10 of 10 episodes solved" in solved.text
    untold = [replace(row, success=None) for row in unscaled]
    policy = findings(replace(run, evaluations=untold, showcase={}))[0]
    assert policy.verdict == "fair"
    assert "random" not in policy.text and "no scale" in policy.text


@pytest.mark.parametrize(
    ("value", "text"), [(386.2, "386"), (9.1667, "9.17"), (-0.7214, "−0.721"), (4223.7, "4224"), (0.0, "0")]
)
def test_numbers_are_short(value: float, text: str) -> None:
    assert number(value) == text
