"""How far a run is, from the files of its directory."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
from tiny_sweeps import OVERRIDES, RUN, write_config, write_end

from bootifol.errors import BootifolError
from bootifol.sweep.beside import error_file, note_failure
from bootifol.sweep.run_state import check_is_planned, run_state


def test_states_from_beginning_to_end(tmp_path: Path) -> None:
    run = tmp_path / "seed1"
    assert str(run_state(run)) == "not begun"
    write_config(run)
    metrics = run / "metrics.jsonl"
    metrics.write_text('{"phase": "alignment", "gradient_step": 40, "seconds": 8.0}\n')
    assert str(run_state(run)) == "40 gradient steps, 8 s"
    with metrics.open("a") as file:
        file.write('{"phase": "interactive", "agent_steps": 12000, "seconds": 200.0}\n{"phase": "inter')
    assert str(run_state(run)) == "12,000 agent steps, 3 min 20 s"
    note_failure(run, "the loss is nan")
    assert str(run_state(run)) == "failed after 12,000 agent steps, 3 min 20 s: the loss is nan"
    error_file(run).unlink()
    (run / "report.html").touch()
    assert str(run_state(run)) == "12,000 agent steps, 3 min 20 s", (
        "a report may be made of a run in progress"
    )
    metrics.unlink()
    write_end(run, 300.0)
    assert str(run_state(run)) == "done: 240 agent steps, 5 min 00 s"


def test_only_the_end_of_long_metrics_is_read(tmp_path: Path) -> None:
    line = '{"phase": "interactive", "agent_steps": %d, "seconds": 1.0}\n'
    (tmp_path / "metrics.jsonl").write_text("".join(line % step for step in range(5000)))
    assert run_state(tmp_path).agent_steps == 4999


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"time_budget": "60s"}, r"begun with time_budget None, and the sweep has 60\.0"),
        ({"seed": 2}, "begun with seed 1, and the sweep has 2"),
        ({"cpus": 2}, "begun with threads 1, and the sweep has 2"),
        (
            {"overrides": (*OVERRIDES, ("alignment.gradient_steps", 0))},
            r"begun with alignment\.gradient_steps 60, and the sweep has 0",
        ),
    ],
)
def test_a_run_begun_otherwise_is_refused(tmp_path: Path, changed: dict[str, object], sentence: str) -> None:
    write_config(tmp_path)
    check_is_planned(RUN, tmp_path)
    with pytest.raises(BootifolError, match=sentence):
        check_is_planned(dataclasses.replace(RUN, **changed), tmp_path)


def test_other_methods_fields_do_not_matter(tmp_path: Path) -> None:
    write_config(tmp_path)
    others = dataclasses.replace(RUN, overrides=(*OVERRIDES, ("reward.virl.references", 3)))
    check_is_planned(others, tmp_path)


def test_a_run_that_is_older_than_a_field_has_its_default(tmp_path: Path) -> None:
    write_config(tmp_path)
    header = json.loads((tmp_path / "config.json").read_text())
    del header["config"]["reward"]["bootifol"]["predicted_states"]
    (tmp_path / "config.json").write_text(json.dumps(header))
    check_is_planned(RUN, tmp_path)
    spoiled = dataclasses.replace(RUN, overrides=(*OVERRIDES, ("reward.bootifol.predicted_states", 3)))
    with pytest.raises(BootifolError, match=r"begun with reward\.bootifol\.predicted_states 2, and .* has 3"):
        check_is_planned(spoiled, tmp_path)
