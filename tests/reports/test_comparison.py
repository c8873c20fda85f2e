from pathlib import Path

import pytest
from made_up_runs import write_run

from bootifol.errors import BootifolError
from bootifol.reports.comparison import Comparison, compare
from bootifol.reports.names import agent_name
from bootifol.reports.run_files import find_runs, read_run


def comparison_of(root: Path, unfinished: bool = False) -> Comparison:
    return compare([read_run(run_dir) for run_dir in find_runs([root])], unfinished=unfinished)


def test_seeds_are_one_group(tmp_path: Path) -> None:
    write_run(tmp_path / "a", seed=2)
    write_run(tmp_path / "b", seed=1)
    comparison = comparison_of(tmp_path)
    (group,) = comparison.groups
    assert group.name == "BootIfOL"
    assert [run.seed for run in group.runs] == [1, 2]
    assert not comparison.notes


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"agent_steps": 400}, "400 of 1,000 agent steps"),
        ({"final_episodes": 50}, "its final evaluation has 2 of 50 episodes"),
        ({"returns": (), "final_episodes": 50}, "its final evaluation is missing"),
        ({"time_budget": 3600.0, "seconds": 90.0}, "1 min 30 s of 1 h 00 min"),
        ({"evaluation": {}}, "its config.json does not say"),
    ],
)
def test_unfinished_runs_are_named_and_left_out(
    tmp_path: Path, changes: dict[str, object], reason: str
) -> None:
    write_run(tmp_path / "done", seed=1)
    write_run(tmp_path / "cut", seed=2, **changes)  # type: ignore[arg-type]
    comparison = comparison_of(tmp_path)
    assert [run.path.name for run in comparison.groups[0].runs] == ["done"]
    (note,) = comparison.notes
    assert str(tmp_path / "cut") in note
    assert "left out" in note
    assert reason in note


def test_a_final_evaluation_of_the_past_is_not_the_end(tmp_path: Path) -> None:
    """Where evaluations on the way are as long as the last one, only the agent steps tell them apart."""
    run_dir = write_run(tmp_path / "a", agent_steps=900)
    with (run_dir / "metrics.jsonl").open("a") as file:
        file.write('{"phase": "interactive", "agent_steps": 1000, "seconds": 70.0, "agent/q": 1.0}\n')
    assert "its final evaluation is missing" in comparison_of(tmp_path).notes[0]


def test_a_spent_time_budget_ends_a_run_before_its_agent_steps(tmp_path: Path) -> None:
    write_run(tmp_path / "a", agent_steps=300, time_budget=60.0, seconds=61.0)
    assert len(comparison_of(tmp_path).groups) == 1


def test_unfinished_runs_that_count_are_named_too(tmp_path: Path) -> None:
    write_run(tmp_path / "a", agent_steps=300)
    comparison = comparison_of(tmp_path, unfinished=True)
    assert len(comparison.groups) == 1
    assert "counts as far as it has come" in comparison.notes[0]


def test_a_copy_counts_once(tmp_path: Path) -> None:
    write_run(tmp_path / "runs" / "a")
    write_run(tmp_path / "results" / "a")
    write_run(tmp_path / "results" / "b", returns=(1.0, 2.0))
    comparison = comparison_of(tmp_path)
    assert [len(group.runs) for group in comparison.groups] == [1]
    assert any("runs/a is a copy of" in note for note in comparison.notes)
    assert any("has the seed and the configuration of" in note for note in comparison.notes)


def test_runs_of_mixed_configurations_are_kept_apart_and_named(tmp_path: Path) -> None:
    write_run(tmp_path / "a", seed=1)
    write_run(tmp_path / "b", seed=2, agent__batch_size=64)
    comparison = comparison_of(tmp_path)
    assert [group.name for group in comparison.groups] == [
        "BootIfOL (batch_size 128)",
        "BootIfOL (batch_size 64)",
    ]
    (note,) = comparison.notes
    assert f"(batch_size 128) {tmp_path / 'a'}; (batch_size 64) {tmp_path / 'b'}" in note
    assert "agent.batch_size (128 / 64)" in note


def test_variants_are_named_by_what_sets_them_apart_from_most(tmp_path: Path) -> None:
    write_run(tmp_path / "a")
    write_run(tmp_path / "b", alignment__gradient_steps=0)
    write_run(tmp_path / "c", alignment__gradient_steps=0, interactive__reward_updates_until=1000)
    write_run(tmp_path / "d", agent__observations="encodings")
    write_run(tmp_path / "e", interactive__reward_updates_until=0)
    comparison = comparison_of(tmp_path)
    assert [group.variant for group in comparison.groups] == [
        "",
        "gradient_steps 0",
        "gradient_steps 0, reward_updates_until 1000",
        "observations encodings",
        "reward_updates_until 0",
    ]


def test_variants_with_too_many_differences_have_letters(tmp_path: Path) -> None:
    write_run(tmp_path / "a")
    many = {f"agent__field_{number}": number for number in range(4)}
    write_run(tmp_path / "b", **many)
    assert [group.name for group in comparison_of(tmp_path).groups] == ["BootIfOL (a)", "BootIfOL (b)"]


def test_runs_of_mixed_versions_are_kept_apart_and_named(tmp_path: Path) -> None:
    write_run(tmp_path / "a", seed=1)
    write_run(tmp_path / "b", seed=2, versions={"bootifol": "0.2.0"})
    write_run(tmp_path / "c", seed=3, versions={"code": "def456"})
    comparison = comparison_of(tmp_path)
    assert [[run.seed for run in group.runs] for group in comparison.groups] == [[1, 3], [2]]
    assert "versions.bootifol (0.1.0 / 0.2.0)" in comparison.notes[0]
    assert "torch" not in comparison.notes[0]
    assert comparison.notes[1] == (
        "Runs on Reacher Hard were made by different versions of the library's code "
        f"(abc123: {tmp_path}/{{a,b}}; def456: {tmp_path}/c)."
    )


def test_runs_that_do_not_know_their_code_are_told(tmp_path: Path) -> None:
    for seed in (1, 2):
        path = write_run(tmp_path / str(seed), seed=seed) / "config.json"
        path.write_text(path.read_text().replace(', "code": "abc123"', ""))
    (note,) = comparison_of(tmp_path).notes
    assert note.startswith("Runs on Reacher Hard are older than the record of the library's code")
    write_run(tmp_path / "new", seed=3)
    comparison = comparison_of(tmp_path)
    assert len(comparison.groups) == 1, "a seed can be added later"
    assert f"unknown: {tmp_path}/{{1,2}}; abc123: {tmp_path}/new" in comparison.notes[0]


def test_other_videos_are_told(tmp_path: Path) -> None:
    def videos(count: int, digest: str) -> dict[str, dict[str, object]]:
        return {"expert": {"count": count, "digest": digest}}

    write_run(tmp_path / "a", seed=1, videos=videos(100, "aa"))
    write_run(tmp_path / "b", seed=2, videos=videos(100, "bb"))
    write_run(tmp_path / "c", seed=3, videos=videos(100, "aa"))
    write_run(tmp_path / "old", seed=4)
    write_run(tmp_path / "d", method="environment", videos=videos(7, "cc"))
    comparison = comparison_of(tmp_path)
    assert [len(group.runs) for group in comparison.groups] == [3 + 1, 1]
    (note,) = comparison.notes
    assert "expert videos that were not the same" in note
    assert note.endswith("100 of digest aa (2 runs), 100 of digest bb (1 run).")


def test_a_time_budget_on_different_processors_is_told(tmp_path: Path) -> None:
    slow, fast = {"processor": "slow"}, {"processor": "fast"}
    write_run(tmp_path / "a", seed=1, versions=slow, time_budget=60.0, seconds=61.0)
    write_run(tmp_path / "b", seed=2, versions=fast, time_budget=60.0, seconds=61.0)
    comparison = comparison_of(tmp_path)
    assert len(comparison.groups) == 1
    assert comparison.notes[0].endswith("buys more or less: slow (1 run), fast (1 run).")
    write_run(tmp_path / "steps" / "a", seed=1, versions=slow)
    write_run(tmp_path / "steps" / "b", seed=2, versions=fast)
    assert not comparison_of(tmp_path / "steps").notes


def test_what_changes_no_number_keeps_no_runs_apart(tmp_path: Path) -> None:
    write_run(tmp_path / "a", seed=1)
    write_run(tmp_path / "b", seed=2, tensorboard=False, reward__virl__margin=2.0)
    assert [len(group.runs) for group in comparison_of(tmp_path).groups] == [2]


def test_unequal_budgets_between_methods_are_named(tmp_path: Path) -> None:
    write_run(tmp_path / "a", time_budget=60.0, seconds=60.0)
    write_run(tmp_path / "b", method="virl", time_budget=30.0, seconds=60.0, agent__batch_size=64)
    notes = comparison_of(tmp_path).notes
    assert "Budgets on Reacher Hard are unequal (BootIfOL: 1 min 00 s; ViRL: 30 s)" in notes[0]
    assert notes[1] == "Also unequal between agents on Reacher Hard: agent.batch_size (128 / 64)."


def test_unequal_terms_are_those_of_the_usual_variant(tmp_path: Path) -> None:
    write_run(tmp_path / "a", agent__batch_size=1)
    write_run(tmp_path / "b")
    write_run(tmp_path / "c", alignment__gradient_steps=7)
    write_run(tmp_path / "virl", method="virl")
    assert not any(note.startswith("Also unequal") for note in comparison_of(tmp_path).notes)


def test_equal_terms_need_no_note(tmp_path: Path) -> None:
    write_run(tmp_path / "a")
    write_run(tmp_path / "b", method="virl", reward__virl__margin=2.0)
    write_run(tmp_path / "c", method="gaifo", task="walker_run", time_budget=9.0)
    assert not comparison_of(tmp_path).notes


def test_a_random_policy_has_no_budget_to_spend_or_to_compare(tmp_path: Path) -> None:
    write_run(tmp_path / "a", method="random", agent_steps=0)
    write_run(tmp_path / "b", time_budget=60.0, seconds=61.0)
    comparison = comparison_of(tmp_path)
    assert [group.name for group in comparison.groups] == ["Random", "BootIfOL"]
    assert not comparison.notes


@pytest.mark.parametrize(
    ("method", "changes", "name"),
    [
        ("context_translation", {}, "CT (n=10)"),
        ("context_translation", {"reward__context_translation__references": 1}, "CT (n=1)"),
        ("bootifol", {"reward__bootifol__reward": "cosine"}, "BootIfOL (cosine)"),
        ("bootifol", {"reward__bootifol__backbone": "google/efficientnet-b0"}, "Eff-BootIfOL"),
        (
            "bootifol",
            {"reward__bootifol__backbone": "facebook/dinov2-small"},
            "BootIfOL (facebook/dinov2-small)",
        ),
        ("bootifol", {"reward__bootifol__backbone": None}, "BootIfOL"),
        ("bootifol", {"agent__cloning_weight": 1e6}, "Cloning alone"),
        ("my_module:Mine", {}, "my_module:Mine"),
    ],
)
def test_agents_have_the_papers_names(
    tmp_path: Path, method: str, changes: dict[str, object], name: str
) -> None:
    run_dir = write_run(tmp_path / "a", method=method, **changes)  # type: ignore[arg-type]
    assert agent_name(read_run(run_dir)) == name


def test_runs_are_found_below_a_directory_and_once(tmp_path: Path) -> None:
    first = write_run(tmp_path / "reacher" / "bootifol" / "seed1")
    second = write_run(tmp_path / "reacher" / "virl" / "seed1")
    (first / "checkpoints").mkdir()
    expanded = [tmp_path / "reacher", first, first / "checkpoints", first / "metrics.jsonl", second]
    assert find_runs(expanded) == [first, second]


def test_a_path_that_leads_to_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BootifolError, match=r"there is no directory .*typo; give directories"):
        find_runs([tmp_path / "typo"])
    with pytest.raises(BootifolError, match="there is no run in"):
        find_runs([tmp_path])
    inside = write_run(tmp_path / "run") / "checkpoints"
    inside.mkdir()
    with pytest.raises(
        BootifolError, match="checkpoints, which lies inside one; give the run's own directory"
    ):
        find_runs([inside])
    with pytest.raises(BootifolError, match="there is no run; name the directory"):
        find_runs([])
