"""What `make bench` times: the same work on all sides, in turn. How fast they are is not asserted."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import pytest
from benchmarks.engine import (
    HEADER,
    Rates,
    Stage,
    agent_update,
    alignment_step,
    label_episode,
    operations_of,
)

from benchmarks import engine
from bootifol.presets import CPU
from bootifol.rewards.bootifol.config import BootifolConfig
from bootifol.rewards.bootifol.model import BootifolRewardModel
from bootifol.rewards.config import RewardConfig
from bootifol.training.config import TrainingConfig

REWARD = replace(CPU.reward.bootifol, width_divisor=16, videos_per_class=2)
CONFIG = replace(CPU, reward=RewardConfig(REWARD), agent=replace(CPU.agent, batch_size=4))
"""The preset with narrow reward networks and few videos."""


@pytest.fixture(autouse=True)
def small_replay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "REPLAY_BYTES", 2_000_000)


@pytest.fixture
def models(monkeypatch: pytest.MonkeyPatch) -> list[BootifolConfig]:
    """The configurations of the reward models made since."""
    made: list[BootifolConfig] = []

    def making(config: BootifolConfig, *others: int) -> BootifolRewardModel:
        made.append(config)
        return BootifolRewardModel(config, *others)

    monkeypatch.setattr(engine, "BootifolRewardModel", making)
    return made


@pytest.mark.parametrize(
    "make",
    [
        agent_update,
        lambda config: alignment_step(config, REWARD),
        lambda config: label_episode(config, REWARD),
    ],
    ids=["update", "alignment", "label"],
)
def test_ours_and_the_plain_version_do_as_much(make: Callable[[TrainingConfig], Stage]) -> None:
    stage = make(CONFIG)
    assert operations_of(stage.plain) == pytest.approx(operations_of(stage.ours), rel=0.2)


def test_what_the_paper_does_not_have_is_left_out(models: list[BootifolConfig]) -> None:
    alignment_step(CONFIG, REWARD)
    as_in_the_paper = replace(REWARD, frames_per_video=None, sequence_times=1, motion=False)
    assert models == [replace(as_in_the_paper, precision=precision) for precision in ("bf16", "fp32")]
    models.clear()
    label_episode(CONFIG, REWARD)
    one_reference = replace(REWARD, references=1, motion=False)
    assert models == [replace(one_reference, precision=precision) for precision in ("bf16", "fp32")]


def test_works_are_timed_in_turn_and_their_first_block_is_not_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 0.0
    done: list[str] = []
    monkeypatch.setattr(engine.time, "perf_counter", lambda: now)

    def work(name: str, seconds: list[float]) -> Callable[[], None]:
        def does() -> None:
            nonlocal now
            now += seconds[done.count(name) // 2]
            done.append(name)

        return does

    works = [work("a", [9.0, 0.003, 0.001, 0.002]), work("b", [0.0, 0.01, 0.02, 0.09])]
    assert engine.medians(works, runs=3, block=2) == pytest.approx([2.0, 20.0])
    assert "".join(done) == "aabb" * 4


def test_the_table_has_a_row_a_stage(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(engine, "CPU", CONFIG)
    monkeypatch.setattr(engine, "measured_rates", lambda: Rates(2e9, 1e12))
    monkeypatch.setattr(engine, "operations_of", lambda _: 8_000_000)
    monkeypatch.setattr(engine, "medians", lambda works, runs, block: [10.0, 25.0, 20.0][: len(works)])
    monkeypatch.setattr(sys, "argv", ["engine", "--sizes", "cpu", "--stages", "label", "alignment"])
    assert engine.main() == 0
    first, _, header, _, *rows = capsys.readouterr().out.splitlines()
    assert first == "1 thread(s), 2 GFLOP/s in bf16, copies of 1000.0 GB/s"
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in (header, *rows)]
    assert cells[0] == list(HEADER)
    for row, title in zip(cells[1:], ("label an episode of 61 frames", "alignment step"), strict=True):
        assert row[0] == "cpu" and row[1].startswith(title)
        assert row[2:] == ["10.0", "20.0", "25.0", "2.5", "4.0", "40%"]
