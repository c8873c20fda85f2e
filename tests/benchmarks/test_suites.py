"""The sweeps of the paper's comparisons: that they are the paper's, and what their numbers follow from."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bootifol.evaluation.tables import EvaluationRow, append_evaluations
from bootifol.presets import BACKBONE, CPU, PAPER
from bootifol.reports.paper_results import RETURNS
from bootifol.reports.result_tables import result_tables
from bootifol.reports.run_files import find_runs, read_run
from bootifol.rewards.registry import METHODS
from bootifol.sweep.planned import RANDOM, PlannedRun
from bootifol.sweep.sweep_file import read_sweep
from bootifol.training.config import TrainingConfig
from bootifol.training.run_config import RunConfig

SUITES = sorted((Path(__file__).parents[2] / "benchmarks" / "suites").glob("*.yaml"))
NAMES = [suite.stem for suite in SUITES]


def runs_of(name: str) -> list[PlannedRun]:
    return read_sweep(SUITES[NAMES.index(name)], trust=True)


def systems(name: str) -> dict[str, PlannedRun]:
    """The first run of each."""
    return {run.system: run for run in reversed(runs_of(name))}


@pytest.mark.parametrize("name", NAMES)
def test_videos_suit_all_who_share_them(name: str) -> None:
    terms: dict[Path, set[object]] = {}
    for run in runs_of(name):
        terms.setdefault(run.demos, set()).add((run.config.pictures, run.config.episode_steps, run.videos))
    assert all(len(found) == 1 for found in terms.values())


def test_the_papers_tables_have_five_seeds_of_everything() -> None:
    runs = runs_of("paper")
    one_seed = 7 * 8 + 3  # a backbone on the three tasks of Meta-World
    assert len(runs) == one_seed * 5
    assert {run.seed for run in runs[:one_seed]} == {1}  # the first seed of everything comes first
    assert runs[0].config == replace(PAPER, threads=1)


@pytest.mark.parametrize("name", ["paper", "cpu"])
def test_a_backbone_stands_beside_the_papers_numbers(name: str) -> None:
    with_number = [task for task, agents in RETURNS.items() if "Eff-BootIfOL" in agents]
    found = [run for run in runs_of(name) if run.variant == "backbone" and run.seed == 1]
    assert [run.task for run in found] == with_number
    assert {run.config.pictures.video_size for run in found} == {BACKBONE.pictures.video_size}


@pytest.mark.parametrize("name", ["paper", "cpu", "backbone"])
def test_a_backbone_has_the_papers_row_of_the_table(tmp_path: Path, name: str) -> None:
    for variant, scaled in (("", 0.4), ("backbone", 0.8)):
        wanted = ("drawer_close", "bootifol", variant)
        run = next(run for run in runs_of(name) if (run.task, run.method, run.variant) == wanted)
        finished(run, tmp_path, scaled)
    table = result_tables([read_run(directory) for directory in find_runs([tmp_path])]).tables[0]
    rows = [
        (row.agent, row.summary and row.summary.mean, row.paper and row.paper.scaled) for row in table.rows
    ]
    assert rows == [("Eff-BootIfOL", 0.8, 0.91), ("BootIfOL", 0.4, 0.53)]


def finished(run: PlannedRun, out: Path, scaled: float) -> None:
    """What tables read of a run that has ended, with one final episode."""
    directory = out / run.name
    directory.mkdir(parents=True)
    config = replace(run.config, evaluation=replace(run.config.evaluation, final_episodes=1))
    RunConfig(run.task, run.method, run.preset, run.seed, "demos", run.seconds, config).write(directory, [])
    steps, seconds = config.interactive.agent_steps, run.seconds or 60.0
    append_evaluations(
        directory / "evaluations.csv",
        [EvaluationRow(steps, seconds, 500, 0, 7, 1000 * scaled, scaled, None)],
    )
    line = {"phase": "interactive", "agent_steps": steps, "seconds": seconds}
    (directory / "metrics.jsonl").write_text(json.dumps(line) + "\n")


def equivalent_steps(config: TrainingConfig, paper_steps: int) -> int:
    """N_train of a run that trains its encoders for the same fraction of its learning as the paper's did.

    Learning begins after the warm-up, which is 0.1 % of the paper's run and a fifth of `cpu`.
    """
    if paper_steps == 0:
        return 0
    before, before_of_paper = config.agent.warm_up_steps, PAPER.agent.warm_up_steps
    fraction = (paper_steps - before_of_paper) / (PAPER.interactive.agent_steps - before_of_paper)
    return before + round((config.interactive.agent_steps - before) * fraction)


@pytest.mark.parametrize("name", ["ablations", "ablations_drawn"])
def test_encoders_learn_for_the_papers_shares_of_the_run(name: str) -> None:
    found = systems(name)
    base = found["bootifol"].config
    for percent, paper_steps in ((0, 0), (6, 100_000), (24, 375_000), (100, 1_550_000)):
        config = found[f"bootifol-trained_{percent}_percent"].config
        assert config.interactive.reward_updates_until == equivalent_steps(base, paper_steps)
    for variant, same_as in (
        ("no_alignment", "trained_24_percent"),
        ("no_alignment_to_the_end", "trained_100_percent"),
    ):
        without, with_alignment = (found[f"bootifol-{end}"].config for end in (variant, same_as))
        assert without.alignment.gradient_steps == 0
        assert without.interactive == with_alignment.interactive


@pytest.mark.parametrize("name", ["paper", "cpu", "reacher", "drawn"])
def test_virl_takes_twice_as_many_gradient_steps_as_bootifol(name: str) -> None:
    """As in the paper, where it learns every 50 agent steps. BootIfOL's are counted with the paper's N_train, or the
    preset's where that is later: one that lets BootIfOL's reward rest sooner should not make ViRL learn less."""
    found = systems(name)
    config = found["bootifol"].config
    interactive, warm_up = config.interactive, config.agent.warm_up_steps
    until = max(
        equivalent_steps(config, PAPER.interactive.reward_updates_until), interactive.reward_updates_until
    )
    bootifol = config.alignment.gradient_steps + (until - warm_up) / interactive.reward_update_every
    virl = found["virl"].config.interactive
    assert virl.reward_update_every == round((interactive.agent_steps - warm_up) / (2 * bootifol))


@pytest.mark.parametrize("name", ["paper", "cpu", "reacher", "drawn"])
def test_context_translation_takes_three_times_as_many_gradient_steps_before_acting(name: str) -> None:
    found = systems(name)
    steps = found["bootifol"].config.alignment.gradient_steps
    for references in (1, 10):
        config = found[f"context_translation-n{references}"].config
        assert config.alignment.gradient_steps == 3 * steps
        assert config.reward.context_translation.references == references


def test_the_learning_test_compares_every_method_and_the_tutorials() -> None:
    assert {run.method for run in runs_of("drawn")} == {
        *METHODS,
        RANDOM,
        "optimal_transport:OptimalTransport",
    }


def test_one_task_of_the_cpus_tables_is_reacher_with_a_time_budget() -> None:
    of_table = [run for run in runs_of("cpu") if (run.task, run.seed) == ("reacher_hard", 1)]
    assert [replace(run, time_budget="60m") for run in of_table] == runs_of("reacher")


def test_a_remedy_is_taken_away_from_the_preset() -> None:
    found = systems("remedies")
    assert found["bootifol-rewards_stored_once"].config.interactive.relabel_episodes == 0
    assert found["bootifol"].config.interactive.relabel_episodes > 0


def test_two_precisions_differ_in_the_arithmetic_of_agent_and_reward_alone() -> None:
    bf16, fp32 = (systems("precision")[f"bootifol-{name}"].config for name in ("bf16", "fp32"))
    assert bf16 != fp32
    changed = replace(bf16.reward.bootifol, precision="fp32")
    reward = replace(bf16.reward, bootifol=changed)
    assert replace(bf16, agent=replace(bf16.agent, precision="fp32"), reward=reward) == fp32


def test_environment_explores_where_the_others_start_as_clones() -> None:
    config = systems("cpu")["environment"].config
    assert config.agent.exploration(10_000) > 0.5 > CPU.agent.exploration(10_000)
