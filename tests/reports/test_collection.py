import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from made_up_runs import write_run

from bootifol.cli.main import main
from bootifol.errors import BootifolError
from bootifol.reports.collection import add_to_collection, read_collection, read_runs
from bootifol.reports.comparison import compare, unfinished_because
from bootifol.reports.run_files import RunFiles, read_run
from bootifol.reports.table_files import table

NOT_KEPT = {"path", "curves", "ranking", "showcase", "video_files", "notes"}
LOSS = "loss/sequence"


@pytest.fixture
def collection(shared_run: Path, tmp_path: Path) -> Path:
    """A run with everything, and two of another method that kept less."""
    add_to_collection(tmp_path / "kept", {"bootifol/seed1": shared_run}, metrics=[LOSS], ranking=True)
    others = {f"virl/seed{seed}": tmp_path / "runs" / f"virl{seed}" for seed in (10, 2)}
    for name, run_dir in others.items():
        write_run(run_dir, method="virl", seed=int(name.removeprefix("virl/seed")), time_budget=60.0)
    add_to_collection(tmp_path / "kept", others)
    return tmp_path / "kept"


def kept(run: RunFiles) -> dict[str, object]:
    """The fields that a collection keeps of every run."""
    fields = (field.name for field in dataclasses.fields(run) if field.name not in NOT_KEPT)
    return {name: getattr(run, name) for name in fields}


def test_a_run_of_a_collection_is_the_run(shared_run: Path, collection: Path, tmp_path: Path) -> None:
    run = read_run(shared_run)
    first, *others = read_runs([collection])
    assert kept(first) == kept(run)
    assert first.ranking == run.ranking
    assert {name for _, name in first.curves} == {LOSS}
    assert first.curves.keys() == {key for key in run.curves if key[1] == LOSS}
    for key, curve in first.curves.items():
        np.testing.assert_array_equal(curve.steps, run.curves[key].steps)
        np.testing.assert_array_equal(curve.values, run.curves[key].values)
    # In the order of their directories, where seed10 comes before seed2.
    assert [other.path for other in others] == [collection / "virl/seed10", collection / "virl/seed2"]
    assert [kept(other) for other in others] == [
        kept(read_run(tmp_path / "runs" / name)) for name in ("virl10", "virl2")
    ]
    assert [(other.ranking, other.curves, other.showcase) for other in others] == [([], {}, {})] * 2
    assert sorted(path.name for path in collection.iterdir()) == [
        *("evaluations.csv", "metrics.csv", "ranking.csv", "runs.json")
    ]


def test_a_run_that_was_cut_counts_as_far_as_it_came(tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "cut", (), curve={100: [1.0]}, agent_steps=700)
    add_to_collection(tmp_path / "kept", {"cut": run_dir})
    (run,) = read_runs([tmp_path / "kept"])
    assert run.agent_steps == 700
    assert unfinished_because(run) == unfinished_because(read_run(run_dir))


def test_parts_of_a_collection_are_named_as_directories_would_be(collection: Path) -> None:
    assert [run.seed for run in read_runs([collection / "virl"])] == [10, 2]
    wanted = [collection / "virl/seed2", collection / "bootifol", collection, collection / "runs.json"]
    assert [run.path.relative_to(collection).as_posix() for run in read_runs(wanted)] == [
        *("virl/seed2", "bootifol/seed1", "virl/seed10")
    ]
    with pytest.raises(BootifolError, match=r"no run vir in the collection .*; it has bootifol, virl"):
        read_runs([collection / "vir"])


def test_runs_and_collections_are_read_alike(collection: Path, tmp_path: Path) -> None:
    runs = read_runs([tmp_path])
    assert [run.path.relative_to(tmp_path).as_posix() for run in runs] == [
        *("kept/bootifol/seed1", "kept/virl/seed10", "kept/virl/seed2", "runs/virl10", "runs/virl2")
    ]
    notes = " ".join(compare(runs).notes)
    assert f"{tmp_path}/runs/virl2 is a copy of {collection}/virl/seed2" in notes
    rows = [line for line in table([collection / "virl"]).splitlines() if line.startswith("|")]
    assert rows == [line for line in table([tmp_path / "runs"]).splitlines() if line.startswith("|")]


def test_a_report_of_a_part_is_written_here(
    collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["report", str(collection / "virl/seed2")]) == 0
    assert "keeps no films and not all metrics" in (tmp_path / "report.html").read_text()
    assert not (collection / "virl").exists()


def test_a_path_that_is_neither_is_refused(tmp_path: Path) -> None:
    for path, sentence in ((tmp_path / "nowhere", "there is no directory"), (tmp_path, "there is no run in")):
        with pytest.raises(BootifolError, match=sentence):
            read_runs([path])
    with pytest.raises(BootifolError, match="there is no run; name the directory"):
        read_runs([])


def test_runs_of_the_same_name_are_replaced(collection: Path, tmp_path: Path) -> None:
    before = {run.path.name: run for run in read_runs([collection])}
    new = write_run(tmp_path / "new", (90.0,), method="virl", seed=2, losses={"sequence": [1.0]})
    add_to_collection(collection, {"virl/seed2": new, "virl/seed3": new}, metrics=[LOSS])
    after = {run.path.name: run for run in read_runs([collection])}
    assert list(after) == ["seed1", "seed10", "seed2", "seed3"]
    for name in ("seed1", "seed10"):
        assert kept(after[name]) == kept(before[name])
    assert after["seed1"].ranking == before["seed1"].ranking
    assert [row.environment_return for row in after["seed2"].evaluations] == [90.0]
    assert after["seed2"].curve("alignment", LOSS) is not None
    add_to_collection(collection, {"virl/seed2": new})
    assert not read_runs([collection / "virl/seed2"])[0].curves


def test_what_cannot_be_kept_is_refused_and_nothing_changes(collection: Path, tmp_path: Path) -> None:
    files = {path: path.read_bytes() for path in collection.iterdir()}
    new = write_run(tmp_path / "new")
    with pytest.raises(BootifolError, match="no run has logged loss/none; choose of agent/q"):
        add_to_collection(collection, {"new": new}, metrics=["loss/none"])
    with pytest.raises(BootifolError, match="new is the directory of a run"):
        add_to_collection(new, {"new": new})
    with pytest.raises(BootifolError, match=r"'\.\./new' is no name for a run"):
        add_to_collection(collection, {"../new": new})
    (new / "evaluations.csv").unlink()
    with pytest.raises(BootifolError, match=r"new has no evaluation to keep; .* evaluations\.csv is missing"):
        add_to_collection(collection, {"new": new})
    assert {path: path.read_bytes() for path in collection.iterdir()} == files


GOOD = {"config.json": {"task": "reacher_hard"}, "agent_steps": 1, "phase_seconds": {}}


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("{", "the list of the runs of the collection .* cannot be read"),
        ("[]", "is no list of runs"),
        (json.dumps({"../up": GOOD}), "'../up' is no name of a run"),
        (json.dumps({"/etc": GOOD}), "'/etc' is no name of a run"),
        (json.dumps({"a\0": GOOD}), "is no name of a run"),
        (json.dumps({"": GOOD}), "'' is no name of a run"),
        (json.dumps({"a": {}}), "does not tell how far a came"),
        (
            json.dumps({"a": GOOD | {"phase_seconds": {"alignment": [1, "2"]}}}),
            "does not tell how far a came",
        ),
        (json.dumps({"a": GOOD | {"phase_seconds": {"lunch": [1, 2]}}}), "does not tell how far a came"),
        (json.dumps({"a": GOOD | {"config.json": 3}}), "runs.json does not describe a run"),
    ],
)
def test_a_damaged_list_of_runs_is_a_sentence(tmp_path: Path, content: str, sentence: str) -> None:
    (tmp_path / "runs.json").write_text(content)
    with pytest.raises(BootifolError, match=sentence):
        read_runs([tmp_path])


def test_damaged_tables_are_told_and_not_added_to(collection: Path, tmp_path: Path) -> None:
    path = collection / "evaluations.csv"
    path.write_text(path.read_text()[:-4])
    (collection / "ranking.csv").write_text("something else\n")
    runs = read_collection(collection)
    assert len(runs[-1].evaluations) == 1
    for run in runs:
        told = " ".join(run.notes)
        assert "evaluations.csv: 1 line could not be read" in told
        assert "ranking.csv was left out" in told
    with pytest.raises(BootifolError, match=r"evaluations\.csv is damaged in line \d+"):
        add_to_collection(collection, {"new": tmp_path / "runs" / "virl2"})
