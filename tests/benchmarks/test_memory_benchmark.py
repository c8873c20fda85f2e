"""The benchmark of memory: what it fills and reads. What a whole process takes is for the command itself."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import memory
from bootifol.errors import BootifolError
from bootifol.replay.buffer import ReplayBuffer


def test_every_slot_of_replay_is_written() -> None:
    replay = ReplayBuffer(50, 8, 2)
    memory.fill(replay, frames=6, size=8, action_dim=2)
    frames = replay.state()["frames"]
    assert len(frames) == 50 and frames.reshape(50, -1).any(axis=1).all()


def test_replay_holds_at_least_the_transitions_asked_for() -> None:
    run = memory.run_of("drawn_home", "smoke", 1000)
    steps = run.resolved_task().episode_steps
    capacity = run.training.agent.replay_capacity
    assert capacity % (steps + 1) == 0
    assert capacity // (steps + 1) * steps >= 1000 > (capacity // (steps + 1) - 1) * steps


def test_slope_of_made_up_readings() -> None:
    flat = memory.line_through({100: 5_000_000, 200: 5_000_000, 300: 5_000_000})
    assert flat.slope == 0.0 and flat.error == 0.0 and flat.readings == 3
    growing = memory.line_through({100: 1000, 200: 3000, 300: 5000, 400: 7000})
    assert growing.slope == pytest.approx(20.0) and growing.error == pytest.approx(0.0, abs=1e-6)
    assert (growing.first_step, growing.last_step, growing.first, growing.last) == (100, 400, 1000, 7000)
    with pytest.raises(BootifolError, match="give it more --steps"):
        memory.line_through({100: 1, 200: 2})


def test_a_line_still_being_written_is_not_read(tmp_path: Path) -> None:
    metrics = tmp_path / "metrics.jsonl"
    assert memory.newest_step(metrics) == 0
    metrics.write_text('{"phase": "alignment", "gradient_step": 10}\n')
    assert memory.newest_step(metrics) == 0
    metrics.write_text(metrics.read_text() + '{"phase": "interactive", "agent_steps": 60}\n{"phase": "inter')
    assert memory.newest_step(metrics) == 60


def test_tables_divide_what_is_resident_by_what_is_announced() -> None:
    stores = [memory.Reading("replay", 100_000_000, 102_000_000), memory.Reading("videos", 10**8, 10**8)]
    lines = memory.stores_table(stores, 2_000_000_000).splitlines()
    assert lines[2] == "| replay | 100.0 | 102.0 | 1.020 |"
    assert lines[4] == "| all of these | 200.0 | 202.0 | 1.010 |"
    assert lines[5].endswith("| 8000.0 | 2000.0 | 0.250 |")
    growth = memory.Growth(500, 2000, 40, 600_000_000, 601_000_000, 650.0, 30.0)
    assert (
        memory.growth_table(growth).splitlines()[2] == "| 500 to 2,000 | 40 | 600.0 | 601.0 | 650.0 | 30.0 |"
    )


@pytest.mark.parametrize(
    ("words", "sentence"), [(["--steps", "3"], "--steps"), (["--transitions", "1"], "--trans")]
)
def test_too_little_to_measure_is_a_sentence(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert memory.main(words) == 2
    assert f"error: {sentence}" in capsys.readouterr().err
