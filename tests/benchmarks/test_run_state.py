"""How far a run is, from the files of its directory."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_state import error_file, run_state
from fake_program import write_config, write_end


def test_states_from_beginning_to_end(tmp_path: Path) -> None:
    run = tmp_path / "seed1"
    assert str(run_state(run)) == "not begun"
    run.mkdir()
    write_config(run, {"task": "drawn_home", "method": "bootifol"})
    metrics = run / "metrics.jsonl"
    metrics.write_text('{"phase": "alignment", "gradient_step": 40, "seconds": 8.0}\n')
    assert str(run_state(run)) == "40 gradient steps, 8 s"
    with metrics.open("a") as file:
        file.write('{"phase": "interactive", "agent_steps": 12000, "seconds": 200.0}\n{"phase": "inter')
    assert str(run_state(run)) == "12,000 agent steps, 3 min 20 s"
    error_file(run).write_text("the loss is nan\n")
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
