"""Nothing in a run's directory is lost, taken over, mixed or led out of it."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tiny_runs import ENDS_SOON, TINY, NoFurther, new_run, no_further, record_demos, resumed

from bootifol import api
from bootifol.cli.main import main
from bootifol.demos.demo_set import DemoSet
from bootifol.errors import BootifolError
from bootifol.files import read_json
from bootifol.locks import one_writer
from bootifol.tracking import RunLog, TensorBoard, cut_metrics
from bootifol.training import open_demos
from bootifol.training.checkpoint import newest_checkpoint
from bootifol.training.interactive import InteractivePhase
from bootifol.training.trainer import Trainer
from bootifol.types import StepMetrics


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    """A run that has ended, to be spoiled."""
    return Path(shutil.copytree(finished, tmp_path / "run"))


def contents(directory: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()
    }


def test_a_copy_without_checkpoints_is_not_begun_anew(run: Path) -> None:
    shutil.rmtree(run / "checkpoints")
    before = contents(run)
    with pytest.raises(BootifolError, match=r"no checkpoint to go on from.*lose its metrics.jsonl"):
        api.resume(run)
    assert contents(run) == before


def test_stray_checkpoints_are_not_taken_over(run: Path, demos: Path) -> None:
    (run / "config.json").unlink()
    before = contents(run)
    with pytest.raises(BootifolError, match=r"holds metrics.jsonl, .*checkpoints of a run whose config"):
        api.train("drawn_reach", demos, run, seed=7, config=ENDS_SOON)
    assert contents(run) == before


def test_a_checkpoint_that_was_being_replaced_is_found(run: Path) -> None:
    newest = newest_checkpoint(run / "checkpoints")
    assert newest is not None
    newest.rename(newest.with_name(f".{newest.name}.0123abcd.old"))
    (newest.with_name(f".{newest.name}.4567cdef.tmp")).mkdir()
    rest = resumed(run)
    assert rest.counters.agent_steps == 90
    assert rest.learn()
    assert [path.name for path in (run / "checkpoints").iterdir()] == [newest.name]


def test_other_videos_at_the_same_place_are_refused(tmp_path: Path, demos: Path) -> None:
    own = shutil.copytree(demos, tmp_path / "demos")
    assert new_run(tmp_path / "run", Path(own), config=ENDS_SOON).learn()
    shutil.rmtree(own)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bootifol.demos.record.Recording.video_seed", lambda self, index: 1000 + index)
        record_demos(Path(own))
    before = contents(tmp_path / "run")
    with pytest.raises(BootifolError, match=r"the expert videos in .* are not the ones that"):
        api.resume(tmp_path / "run")
    assert main(["score", str(tmp_path / "run"), str(own)]) == 2
    assert contents(tmp_path / "run") == before


def test_two_writers_are_one_too_many(run: Path, demos: Path, tmp_path: Path) -> None:
    before = contents(run)
    with one_writer(run):
        for write in (lambda: api.resume(run), lambda: api.train("drawn_reach", demos, run)):
            with pytest.raises(BootifolError, match="another process is writing to"):
                write()
    assert contents(run) == before
    with one_writer(demos / "expert"):
        assert main(["demos", "record", "--task", "drawn_reach", "--out", str(demos)]) == 2


@pytest.mark.parametrize("name", ["metrics.jsonl", "checkpoints", "tensorboard"])
def test_a_link_that_leaves_the_run_is_not_written_through(run: Path, tmp_path: Path, name: str) -> None:
    target = tmp_path / "mine"
    if (run / name).exists():
        shutil.move(run / name, target)
    else:
        target.mkdir()
    (run / name).symlink_to(target)
    with pytest.raises(BootifolError, match=f"{name} is a link that leaves the run"):
        api.resume(run)


@pytest.mark.parametrize(("kept", "lines"), [(10_000, 3), (25, 3), (24, 2), (23, 1), (11, 0)])
def test_metrics_are_cut_to_whole_lines_and_never_made_longer(tmp_path: Path, kept: int, lines: int) -> None:
    path = tmp_path / "metrics.jsonl"
    path.write_bytes(b'{"a": 1234}\n{"b": 5678}\n\n{"half')
    missing = cut_metrics(path, kept)
    assert b"\0" not in path.read_bytes()
    assert path.read_bytes().count(b"\n") == lines
    assert missing == kept - path.stat().st_size


def test_metrics_shorter_than_the_checkpoint_knows_get_no_zeros(run: Path) -> None:
    path = run / "metrics.jsonl"
    path.write_bytes(path.read_bytes()[:-30])
    assert resumed(run).learn()
    assert b"\0" not in path.read_bytes()
    assert all(json.loads(line) for line in path.read_text().splitlines())


def test_tensorboard_drops_what_was_undone(tmp_path: Path) -> None:
    with RunLog(tmp_path, TensorBoard(tmp_path)) as tracker:
        tracker.log("alignment", "gradient_step", 4000, 0.0, {"loss/total": 2.0})
        tracker.log("interactive", "agent_steps", 60, 0.0, {"loss/total": 1.0})
        at_checkpoint = tracker.bytes_written()
        tracker.log("interactive", "agent_steps", 120, 0.0, {"loss/total": 0.0})
    cut_metrics(tmp_path / "metrics.jsonl", at_checkpoint)
    with RunLog(tmp_path, TensorBoard(tmp_path)) as tracker:
        tracker.log("interactive", "agent_steps", 90, 0.0, {"loss/total": 0.5})
    events = EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    assert [(e.step, e.value) for e in events.Scalars("interactive/loss/total")] == [(60, 1.0), (90, 0.5)]
    assert [(e.step, e.value) for e in events.Scalars("alignment/loss/total")] == [(4000, 2.0)]


@pytest.mark.parametrize("where", ["_append", "add_scalar"])
def test_a_full_disk_at_a_line_of_metrics_is_a_sentence(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    run = new_run(tmp_path / "run", demos, config=replace(ENDS_SOON, tracker="tensorboard"))
    owner = RunLog if where == "_append" else "torch.utils.tensorboard.SummaryWriter"
    calls: list[object] = []
    whole = RunLog._append

    def full(*arguments: object, **_: object) -> None:
        calls.append(arguments)
        if len(calls) < 2 and where == "_append":
            return whole(*arguments)
        raise OSError(errno.ENOSPC, "No space left on device")

    if isinstance(owner, str):
        monkeypatch.setattr(f"{owner}.{where}", full)
    else:
        monkeypatch.setattr(owner, where, full)
    with pytest.raises(BootifolError, match=r"No space left on device.*train --resume"):
        run.learn()
    monkeypatch.undo()
    assert resumed(tmp_path / "run").learn()


def test_a_closed_terminal_is_a_stop_unless_the_run_was_to_outlive_it(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    play = InteractivePhase.play_episode

    def hung_up(self: InteractivePhase) -> list[StepMetrics]:
        if self.counters.episodes == 1:
            os.kill(os.getpid(), signal.SIGHUP)
        return play(self)

    monkeypatch.setattr(InteractivePhase, "play_episode", hung_up)
    assert not new_run(tmp_path / "stops", demos, config=ENDS_SOON).learn()
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert new_run(tmp_path / "stays", demos, config=ENDS_SOON).learn()
    finally:
        signal.signal(signal.SIGHUP, before)


def test_large_sets_are_verified_while_the_run_learns(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = Path(shutil.copytree(demos, tmp_path / "demos"))
    monkeypatch.setattr(open_demos, "_VERIFY_BELOW_BYTES", 0)
    shard = own / "random" / "shard-00000.npy"
    flipped = bytearray(shard.read_bytes())
    flipped[-1] ^= 1
    shard.write_bytes(flipped)
    with pytest.raises(BootifolError, match=r"shard-00000.npy is damaged: the pixels of"):
        run = new_run(tmp_path / "run", own, config=ENDS_SOON)
        run.learn()
        run.finish()


def test_videos_replaced_under_a_run_are_noticed(tmp_path: Path, demos: Path) -> None:
    own = Path(shutil.copytree(demos, tmp_path / "demos"))
    demo_set = DemoSet.open(own / "expert")
    shard = own / "expert" / "shard-00000.npy"
    os.utime(shard)
    assert demo_set[0].frames.any(), "touched, and still the same"
    shutil.copy(own / "random" / "shard-00000.npy", shard)
    with pytest.raises(BootifolError, match="was replaced or changed while it was in use"):
        demo_set.sample(12, np.random.default_rng(0))


@pytest.mark.parametrize(
    "change",
    [
        {"random_state": {}},
        {"random_state": [1]},
        {"random_state": {"bit_generator": "MT19937", "state": {}}},
        {
            "random_state": {
                "bit_generator": "PCG64",
                "state": {"state": -1, "inc": 1},
                "has_uint32": 0,
                "uinteger": 0,
            }
        },
        {"metrics_bytes": -5},
        {"metrics_bytes": "x"},
        {"counters": {"agent_steps": "90"}},
        {"counters": {"agent_steps": -90}},
        {"counters": []},
        {"format": [2]},
    ],
)
def test_a_wrong_index_of_a_checkpoint_is_a_sentence(run: Path, change: dict[str, object]) -> None:
    newest = newest_checkpoint(run / "checkpoints")
    assert newest is not None
    index = read_json(newest / "checkpoint.json", "it")
    (newest / "checkpoint.json").write_text(json.dumps(index | change))
    with pytest.raises(BootifolError, match=r"checkpoint\.json is damaged|checkpoint format"):
        resumed(run)


def test_a_changed_configuration_is_told(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    resumed(run)
    assert "was changed since" not in capsys.readouterr().err
    path = run / "config.json"
    path.write_text(path.read_text().replace('"seed": 1', '"seed": 3'))
    resumed(run)
    assert "config.json was changed since bootifol wrote it" in capsys.readouterr().err


def test_a_run_has_a_checkpoint_from_its_first_moment(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Trainer, "_align", no_further)
    with pytest.raises(NoFurther):
        new_run(tmp_path / "run", demos, config=TINY).learn()
    assert newest_checkpoint(tmp_path / "run" / "checkpoints") is not None
