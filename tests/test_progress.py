import pytest
from rich.console import Console

from bootifol import progress as module
from bootifol.progress import duration, progress


def test_without_a_terminal_it_prints_a_first_and_a_last_line_only(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with progress("recording expert", total=3) as advance:
        for _ in range(3):
            advance(loss=0.25)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "recording expert: 0/3"
    assert lines[-1].startswith("recording expert: 3/3, done in ")
    assert lines[-1].endswith("loss=0.25")
    assert len(lines) == 2


def test_lines_come_every_half_minute_with_rate_and_remaining_time(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    monkeypatch.setattr(module.time, "monotonic", lambda: now)
    with progress("aligning", total=400, done=100) as advance:
        for _ in range(61):
            now += 1.0
            advance(2)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "aligning: 100/400",
        "aligning: 160/400, 2/s, 2 min 00 s left",
        "aligning: 220/400, 2/s, 1 min 30 s left",
        "aligning: 222/400, 2/s, 1 min 29 s left",
    ]


def test_seconds_of_a_budget_are_told_as_time_without_a_rate(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    monkeypatch.setattr(module.time, "monotonic", lambda: now)
    with progress("acting", total=300, unit="seconds") as advance:
        now += 40.0
        advance(39)
    lines = capsys.readouterr().err.splitlines()
    assert lines[:2] == ["acting: 0 s of 5 min 00 s", "acting: 39 s of 5 min 00 s, 4 min 21 s left"]


def test_the_unit_follows_the_count(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("cloning", total=1, unit="steps") as advance:
        advance()
    assert capsys.readouterr().err.splitlines()[0] == "cloning: 0/1 steps"


def test_an_error_inside_is_not_swallowed() -> None:
    with pytest.raises(KeyError), progress("failing", total=2):
        raise KeyError("inside")


def test_on_a_terminal_it_draws_a_bar(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        module, "Console", lambda stderr: Console(stderr=stderr, force_terminal=True, width=120)
    )
    with progress("recording", total=4, done=1) as advance:
        advance(3, reward=-1.5)
    drawn = capsys.readouterr().err
    assert "recording" in drawn
    assert "4/4" in drawn
    assert "reward=-1.5" in drawn


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "0 s"), (59.6, "1 min 00 s"), (200, "3 min 20 s"), (3599.9, "1 h 00 min"), (7500, "2 h 05 min")],
)
def test_durations_read_well(seconds: float, text: str) -> None:
    assert duration(seconds) == text
