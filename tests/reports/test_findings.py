import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_runs import write_run
from synthetic_run import AGENT_STEPS, write_synthetic_run

from bootifol.evaluation.tables import RankingRow, append_ranking
from bootifol.reports.final_return import final_return
from bootifol.reports.findings import Finding, findings, short_number
from bootifol.reports.run_files import RunFiles, read_run


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


STARTS = 5


def run_of(
    run_dir: Path,
    returns: Sequence[float],
    rewards: Sequence[float],
    cloned: int = 0,
    noise: float = 1.0,
    scaled: float = 0.5,
    **changes: Any,
) -> RunFiles:
    """A run with these true returns, one an evaluation, and learned rewards; the evaluation `cloned` ends a clone."""
    rng = np.random.default_rng(0)
    every = 1000
    curve = {every * (n + 1): list(mean + noise * rng.normal(size=STARTS)) for n, mean in enumerate(returns)}
    steps = every * len(returns)
    directory = write_run(run_dir, [100 * scaled] * STARTS, agent_steps=steps, curve=curve, **changes)
    records = [
        {
            "phase": "interactive",
            "agent_steps": steps * (n + 1) // len(rewards),
            "seconds": 1.0,
            "episode/learned_reward": reward,
        }
        for n, reward in enumerate(rewards)
    ]
    if cloned:
        end = read_run(directory).evaluations_of(60)[every * (cloned + 1)][0].seconds
        for number, seconds in enumerate((end - 2, end - 1, end)):
            records.append({"phase": "cloning", "gradient_step": number, "seconds": seconds, "agent/x": 0.1})
    with (directory / "metrics.jsonl").open("a") as file:
        file.writelines(json.dumps(record) + "\n" for record in records)
    return read_run(directory)


RISING, FLAT = np.linspace(-2, -1, 40), np.full(40, -1.5)


def following(run: RunFiles) -> Finding | None:
    told = [finding for finding in findings(run) if "earned a learned reward" in finding.text]
    return told[0] if told else None


def cloning(run: RunFiles) -> Finding | None:
    told = [finding for finding in findings(run) if "Cloning the videos" in finding.text]
    return told[0] if told else None


@pytest.mark.parametrize("rewards", [RISING, FLAT, -RISING])
def test_a_jump_by_cloning_is_told_as_such_and_only_what_came_after_is_compared(
    tmp_path: Path, rewards: Sequence[float]
) -> None:
    run = run_of(tmp_path / "cloned", [0, 0, *[90] * 10], rewards, cloned=2)
    jump, told = cloning(run), following(run)
    assert jump is not None and told is not None
    assert jump.verdict == "good"
    assert re.search(r"in 60 agent steps from [−0-9.]+ to (89|90)", jump.text)
    assert told.verdict == "fair"
    assert "neither clearly improved nor clearly spoiled the clone" in told.text


def test_rewards_before_the_clone_do_not_count(tmp_path: Path) -> None:
    rewards = [*[5.0] * 10, *[-1.0] * 25, *[-0.5] * 25]
    told = following(run_of(tmp_path / "cloned", [0, 0, *[90] * 10], rewards, cloned=2))
    assert told is not None and told.text.startswith("After the Cloning Phase")
    assert "of −1 per step at first and −0.5" in told.text


def test_of_several_clones_the_last_is_told_too(tmp_path: Path) -> None:
    run = run_of(tmp_path / "cloned", [0, 0, 68, 70, 91, 91], FLAT, cloned=4, noise=0)
    run = replace(run, phase_seconds={**run.phase_seconds, "cloning": (150.0, 300.0)})
    jump = cloning(run)
    assert jump is not None
    assert jump.text == (
        "Cloning the videos took the true return in 60 agent steps from 0 to 68; "
        "after the last Cloning Phase it was 91."
    )
    assert following(run) is None  # two evaluations are no time to learn in


@pytest.mark.parametrize(("after", "verdict", "word"), [(100, "fair", "rose"), (40, "poor", "spoiled")])
def test_what_became_of_the_clone(tmp_path: Path, after: float, verdict: str, word: str) -> None:
    returns = [0, 0, *[70] * 4, *[after] * 8]
    told = following(run_of(tmp_path / "cloned", returns, RISING, cloned=2))
    assert told is not None
    assert told.verdict == verdict
    assert word in told.text


@pytest.mark.parametrize(
    ("returns", "rewards", "scaled", "verdict", "word"),
    [
        ((0, 0, 5, 10, 20, 30, 40, 40), RISING, 0.5, "good", "the reward leads to the task"),
        ((0, 0, 5, 10, 20, 30, 40, 40), FLAT, 0.5, "fair", "although the true return rose"),
        ((40, 40, 30, 20, 10, 5, 0, 0), RISING, 0.0, "poor", "leads away from the task"),
        ((40, 40, 30, 20, 10, 5, 0, 0), FLAT, 0.0, "poor", "fell from"),
        ((0,) * 8, RISING, 0.0, "poor", "does not lead to the task"),
        ((0,) * 8, FLAT, 0.0, "poor", "has not learned"),
        ((40,) * 8, RISING, 0.9, "fair", "did not clearly rise"),
    ],
)
def test_reward_and_return_are_compared(
    tmp_path: Path, returns: Sequence[float], rewards: Sequence[float], scaled: float, verdict: str, word: str
) -> None:
    told = following(run_of(tmp_path / "run", returns, rewards, scaled=scaled))
    assert told is not None
    assert told.verdict == verdict
    assert word in told.text


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_rise_and_no_fall(tmp_path: Path, seed: int) -> None:
    returns = np.random.default_rng(seed).normal(40, 5, 8)
    told = following(run_of(tmp_path / "run", list(returns), FLAT, noise=30.0))
    assert told is not None
    assert "did not clearly rise" in told.text


def test_too_few_evaluations_give_no_verdict(tmp_path: Path) -> None:
    assert following(run_of(tmp_path / "run", (0, 0, 10, 20, 30, 40, 40), RISING)) is None


def test_the_same_starts_played_again_do_not_count_again(tmp_path: Path) -> None:
    """One start of five is solved at first and four at last: a rise in 40 episodes, and nothing in 5."""
    run = run_of(tmp_path / "run", [0] * 32, RISING)
    solved = {steps: 1 if steps <= 16_000 else 4 for steps in run.evaluations_of(60)}
    rows = [
        replace(row, environment_return=90.0 * (row.episode < solved[row.agent_steps]))
        for row in run.evaluations
        if row.episode_steps == 60
    ]
    repeated = following(replace(run, evaluations=rows))
    others = following(replace(run, evaluations=[replace(row, seed=n) for n, row in enumerate(rows)]))
    assert repeated is not None and "did not clearly rise" in repeated.text
    assert others is not None and "rose" in others.text


@pytest.mark.parametrize("changes", [{"method": "environment"}, {"agent__cloning_weight": 1e6}])
def test_where_no_learned_reward_is_heard_none_is_judged(tmp_path: Path, changes: dict[str, Any]) -> None:
    run = run_of(tmp_path / "run", (0, 0, 5, 10, 20, 30, 40, 40), RISING, **changes)
    assert following(run) is None


def test_a_run_that_learned_nothing_is_told_so(tmp_path: Path) -> None:
    run = read_run(write_synthetic_run(tmp_path / "idle", final=0.0))
    policy, _, followed, showcase = findings(run)
    assert (policy.verdict, followed.verdict, showcase.verdict) == ("poor", "poor", "poor")


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
    assert short_number(value) == text


def test_without_half_good_videos_the_reward_is_judged_by_random_ones(tmp_path: Path) -> None:
    run = tmp_path / "run"
    write_synthetic_run(run)
    (run / "ranking.csv").unlink()
    for steps, below in ((0, 2), (900, 1)):
        expert = [RankingRow(steps, "expert", f"e{n}", float(n)) for n in range(10)]
        random = [RankingRow(steps, "random", f"r{n}", -1.0 if n >= below else 99.0) for n in range(10)]
        append_ranking(run / "ranking.csv", [*expert, *random])
    (told,) = [finding for finding in findings(read_run(run)) if "unseen expert" in finding.text]
    assert "above a random one in 90% of pairs (a coin: 50%); before the agent acted it was 80%" in told.text
    assert told.verdict == "fair"


@pytest.mark.parametrize(
    ("budget", "wanted", "told"),
    [
        (None, 500, None),  # nothing limits the time
        (600.0, 40, None),  # half of them were taken
        (
            600.0,
            500,
            "The time was too short: alignment took 20 of its 500 gradient steps and the agent had no update. "
            "Give a longer --time-budget, or a quicker --preset.",
        ),
    ],
)
def test_what_time_cut_off_comes_first(
    tmp_path: Path, budget: float | None, wanted: int, told: str | None
) -> None:
    directory = write_run(
        tmp_path / "run", time_budget=budget, losses={"total": [1, 1]}, alignment__gradient_steps=wanted
    )
    if wanted == 40:
        with (directory / "metrics.jsonl").open("a") as file:
            file.write(
                '{"phase": "interactive", "agent_steps": 1000, "seconds": 9, "agent/critic_loss": 1.0}\n'
            )
    first = findings(read_run(directory))[0]
    if told is None:
        assert "too short" not in first.text
    else:
        assert first == Finding("poor", told)


def test_a_cloning_phase_that_was_cut_off_is_told(tmp_path: Path) -> None:
    clones = {"fraction": 0.25, "inverse_dynamics_updates": 10, "cloning_updates": 10}
    directory = write_run(tmp_path / "run", time_budget=600.0, demonstrations=clones)
    with (directory / "metrics.jsonl").open("a") as file:
        file.write('{"phase": "cloning", "gradient_step": 9, "seconds": 5, "agent/cloning_loss": 1.0}\n')
        file.write('{"phase": "interactive", "agent_steps": 1000, "seconds": 9, "agent/critic_loss": 1.0}\n')
    first = findings(read_run(directory))[0]
    assert first.verdict == "poor" and "cloning took 9 of its 20 gradient steps" in first.text


def test_a_policy_worse_than_random_is_told_so(tmp_path: Path) -> None:
    first = findings(read_run(write_run(tmp_path / "run", returns=(-20.0, -10.0))))[0]
    assert first.verdict == "poor" and first.text.endswith("It is worse than random actions.")


def test_sight_speaks_for_the_reward_where_somebody_could_fail(tmp_path: Path) -> None:
    directory = write_run(tmp_path / "run", [50.0] * STARTS)
    moments = ((0, 0.7, 0.9), (5000, 0.97, 0.99))
    with (directory / "metrics.jsonl").open("a") as file:
        for steps, late, still in moments:
            record = {"phase": "interactive", "agent_steps": steps, "seconds": 1.0, "sight/spearman": 0.8}
            file.write(json.dumps({**record, "sight/auc:late": late, "sight/auc:still": still}) + "\n")
    run = read_run(directory)
    assert run.sight_moments()[0] == {"spearman": 0.8, "auc:late": 0.7, "auc:still": 0.9}
    (sight,) = [finding for finding in findings(run) if "plausible failures" in finding.text]
    assert sight.verdict == "good"
    assert "97%" in sight.text and "70%" in sight.text
