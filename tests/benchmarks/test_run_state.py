"""How far a run is, from the files of its directory."""

from __future__ import annotations

from pathlib import Path

from benchmarks.run_state import error_file, run_state


def test_states_from_beginning_to_end(tmp_path: Path) -> None:
    run = tmp_path / "seed1"
    assert str(run_state(run)) == "not begun"
    run.mkdir()
    (run / "config.json").write_text("{}")
    metrics = run / "metrics.jsonl"
    metrics.write_text('{"phase": "alignment", "gradient_step": 40, "seconds": 8.0}\n')
    assert str(run_state(run)) == "40 gradient steps, 8 s"
    with metrics.open("a") as file:
        file.write('{"phase": "interactive", "agent_steps": 12000, "seconds": 200.0}\n{"phase": "inter')
    assert str(run_state(run)) == "12,000 agent steps, 3 min 20 s"
    error_file(run).write_text("the loss is nan\n")
    assert str(run_state(run)) == "failed after 12,000 agent steps, 3 min 20 s: the loss is nan"
    (run / "report.html").touch()
    assert str(run_state(run)) == "done: 12,000 agent steps, 3 min 20 s"


def test_only_the_end_of_long_metrics_is_read(tmp_path: Path) -> None:
    line = '{"phase": "interactive", "agent_steps": %d, "seconds": 1.0}\n'
    (tmp_path / "metrics.jsonl").write_text("".join(line % step for step in range(5000)))
    assert run_state(tmp_path).agent_steps == 4999
