"""The queue, with a program that stands for `bootifol`."""

from __future__ import annotations

import dataclasses
import fcntl
import functools
import itertools
import json
import os
import shutil
import sys
from pathlib import Path

import pytest
from benchmarks.run_queue import RunQueue, cores, missing_demos, record_words, what_went_wrong
from benchmarks.run_state import run_state
from benchmarks.suites import OPTIMAL_TRANSPORT, Overrides, PlannedRun, System, backbone_comparison
from fake_program import write_config, write_end

from bootifol.demos.record import record
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.presets import BACKBONE, CPU, SMOKE

AS_FAKED: Overrides = (
    ("interactive.agent_steps", 240),
    ("agent.warm_up_steps", 60),
    ("evaluation.final_episodes", 1),
)
"""So short is what `fake_program.py` plays."""

FAKE = (sys.executable, str(Path(__file__).with_name("fake_program.py")))


@pytest.fixture(scope="module")
def demo_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("recorded") / "random"
    record("drawn_home", "random", 2, directory, PictureConfig(agent_size=8, video_size=8))
    return directory


@pytest.fixture
def suite(tmp_path: Path, demo_set: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory to work in, where `demos record` will find what to give."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FAKE_DEMOS", str(demo_set))
    (planned_run,) = planned("bootifol")
    (tmp_path / "config").write_text(json.dumps(dataclasses.asdict(planned_run.config)))
    monkeypatch.setenv("FAKE_CONFIG", str(tmp_path / "config"))
    return tmp_path


def planned(*methods: str, task: str = "drawn_home", seed: int = 1) -> list[PlannedRun]:
    return [PlannedRun(task, "smoke", System(method, overrides=AS_FAKED), seed) for method in methods]


def queue(suite: Path, runs: list[PlannedRun], workers: int = 1, lines: list[str] | None = None) -> RunQueue:
    said = lines if lines is not None else []
    return RunQueue(runs, suite / "out", suite / "demos", workers, program=FAKE, say=said.append)


def calls(suite: Path) -> list[str]:
    """Every call so far, without cores and threads."""
    return [" ".join(line.split()[:2]) for line in (suite / "calls.txt").read_text().splitlines()]


def test_runs_are_done_in_order_and_once(suite: Path) -> None:
    runs = planned("bootifol", "environment")
    assert str(queue(suite, runs).work()) == "2 done, 0 failed, 0 left"
    expected = ["record drawn_home", "train bootifol/seed1", "train environment/seed1"]
    assert calls(suite) == expected
    assert (suite / "out" / "drawn_home" / "bootifol" / "seed1" / "report.html").is_file()
    assert queue(suite, runs).work().done == 2
    assert calls(suite) == expected


def test_the_tutorials_method_lies_where_its_run_looks_for_it(
    suite: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", "mine")
    queue(suite, planned("bootifol")).work()
    assert not (suite / "out" / "modules").exists()
    assert queue(suite, planned(OPTIMAL_TRANSPORT)).work().done == 1
    module = (suite / "out" / "modules" / "optimal_transport.py").read_text()
    assert "class OptimalTransport" in module
    assert (suite / "path.txt").read_text() == os.pathsep.join([str(suite / "out" / "modules"), "mine"])


def test_a_failed_run_stops_no_other_and_is_tried_again(suite: Path) -> None:
    runs, lines = planned("gaifo", "bootifol"), []
    assert str(queue(suite, runs, lines=lines).work()) == "1 done, 1 failed, 0 left"
    directory = suite / "out" / "drawn_home" / "gaifo" / "seed1"
    assert run_state(directory).error == "the loss is nan"
    assert "a line before" in directory.with_name("seed1.log").read_text()
    assert any(line.startswith("failed     drawn_home/gaifo/seed1: the loss is nan (see") for line in lines)
    queue(suite, runs).work()
    assert calls(suite)[1:] == ["train gaifo/seed1", "train bootifol/seed1", "resume gaifo/seed1"]


def test_ctrl_c_lets_runs_write_checkpoints_and_the_same_command_goes_on(suite: Path) -> None:
    runs, lines = planned("virl", "bootifol"), []
    assert str(queue(suite, runs, lines=lines).work()) == "0 done, 0 failed, 2 left"
    assert (suite / "out" / "drawn_home" / "virl" / "seed1" / "checkpoints").is_dir()
    assert lines[-1] == "stopped    drawn_home/virl/seed1: the same command goes on with it"
    assert queue(suite, runs).work().done == 2
    assert calls(suite)[1:] == ["train virl/seed1", "resume virl/seed1", "train bootifol/seed1"]


def test_a_run_that_is_stopped_alone_did_not_fail_and_stops_no_other(suite: Path) -> None:
    runs, lines = planned("context_translation", "bootifol"), []
    assert str(queue(suite, runs, lines=lines).work()) == "1 done, 0 failed, 1 left"
    assert "stopped    drawn_home/context_translation/seed1: the same command goes on with it" in lines
    assert queue(suite, runs).work().done == 2
    assert calls(suite)[-1] == "resume context_translation/seed1"


def test_a_second_ctrl_c_ends_runs_at_once(suite: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FAKE_CTRL_C", "twice")
    with pytest.raises(KeyboardInterrupt):
        queue(suite, planned("virl")).work()
    with pytest.raises(ProcessLookupError):
        os.kill(int((suite / "pid.txt").read_text()), 0)


def test_each_worker_has_a_core_and_a_thread(suite: Path) -> None:
    usable = cores(1)
    if usable == [None]:
        pytest.skip("this system pins no process")
    queue(suite, planned("bootifol")).work()
    *_, threads, core = (suite / "calls.txt").read_text().split()
    assert (threads, core) == ("1", str(usable[0]))


def test_more_workers_than_cores_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5}, raising=False)
    assert cores(2) == [3, 5]
    with pytest.raises(BootifolError, match="use --workers 2 at most"):
        cores(3)


def test_tasks_without_videos_fail_alone(suite: Path) -> None:
    runs = [*planned("bootifol", task="hopper_stand"), *planned("bootifol")]
    lines: list[str] = []
    assert str(queue(suite, runs, lines=lines).work()) == "1 done, 1 failed, 0 left"
    error = run_state(suite / "out" / "hopper_stand" / "bootifol" / "seed1").error
    assert error == "its videos could not be recorded: no expert is bundled for hopper_stand"
    assert any(line.endswith(f"(see {suite / 'demos' / 'hopper_stand.log'})") for line in lines)


def test_as_many_videos_are_recorded_as_wanted(suite: Path) -> None:
    queue(suite, planned("bootifol")).work()
    other = RunQueue(
        planned("environment"), suite / "out", suite / "more", videos=7, program=FAKE, say=lambda _: None
    )
    other.work()
    recorded = [line for line in (suite / "calls.txt").read_text().splitlines() if line.startswith("record")]
    assert recorded == ["record drawn_home 12 at 64", "record drawn_home 7 at 64"]


def test_videos_are_as_long_as_the_runs_want_them() -> None:
    words = record_words("reacher_hard", BACKBONE, Path("demos"), 3, ["expert"])
    options = dict(itertools.pairwise(words))
    assert (options["--episode-steps"], options["--video-size"], options["--episodes"]) == ("50", "224", "3")
    assert "--episode-steps" not in record_words("reacher_hard", CPU, Path("demos"), 3, ["expert"])


def test_a_backbone_has_larger_videos_in_a_directory_of_their_own(suite: Path) -> None:
    runs = [PlannedRun("drawn_home", "smoke", system, 1) for system in backbone_comparison(SMOKE, False)]
    assert queue(suite, runs).work().done == 2
    recorded = [line for line in (suite / "calls.txt").read_text().splitlines() if line.startswith("record")]
    assert recorded == ["record drawn_home 12 at 64", "record drawn_home 12 at 224"]
    for run, demos in zip(runs, ("drawn_home", "drawn_home-224"), strict=True):
        log = (suite / "out" / f"{run.name}.log").read_text()
        assert f"--demos {suite / 'demos' / demos} " in log


def test_imported_videos_are_used_and_random_ones_recorded_beside_them(suite: Path, demo_set: Path) -> None:
    (suite / "mine").mkdir()
    assert missing_demos(suite / "mine") == ["expert", "random", "half_good"]
    (suite / "mine" / "expert").symlink_to(demo_set)
    assert missing_demos(suite / "mine") == ["random"]
    (suite / "mine" / "random").symlink_to(demo_set)
    assert missing_demos(suite / "mine") == []


def test_two_queues_do_not_share_a_directory(suite: Path) -> None:
    (suite / "out").mkdir()
    with (suite / "out" / ".queue.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(BootifolError, match="another queue works in"):
            queue(suite, planned("bootifol")).work()


def test_a_run_begun_otherwise_is_refused(suite: Path) -> None:
    queue(suite, planned("bootifol")).work()
    with pytest.raises(BootifolError, match=r"begun with time_budget None, and this suite has 60\.0"):
        RunQueue(planned("bootifol"), suite / "out", suite / "demos", time_budget="60s", program=FAKE)
    without = System("bootifol", overrides=(*AS_FAKED, ("alignment.gradient_steps", 0)))
    with pytest.raises(BootifolError, match=r"begun with alignment\.gradient_steps 60, and this suite has 0"):
        queue(suite, [PlannedRun("drawn_home", "smoke", without, 1)])


def test_a_run_that_is_older_than_a_field_has_its_default(suite: Path) -> None:
    queue(suite, planned("bootifol")).work()
    path = suite / "out" / "drawn_home" / "bootifol" / "seed1" / "config.json"
    header = json.loads(path.read_text())
    del header["config"]["reward"]["bootifol"]["spoiled_share"]
    path.write_text(json.dumps(header))
    queue(suite, planned("bootifol"))
    spoiled = System("bootifol", overrides=(*AS_FAKED, ("reward.bootifol.spoiled_share", 0.5)))
    with pytest.raises(
        BootifolError, match=r"begun with reward\.bootifol\.spoiled_share 0\.0, and .* has 0\.5"
    ):
        queue(suite, [PlannedRun("drawn_home", "smoke", spoiled, 1)])


def test_kept_results_stand_for_the_run_on_another_machine(suite: Path) -> None:
    runs, kept = planned("bootifol", "gaifo"), suite / "kept"
    keeping = functools.partial(
        RunQueue, runs, demos=suite / "demos", program=FAKE, say=lambda _: None, kept=kept
    )
    assert str(keeping(out=suite / "out").work()) == "1 done, 1 failed, 0 left"
    shutil.rmtree(kept)
    assert str(keeping(out=suite / "out").work()) == "1 done, 1 failed, 0 left"
    assert {path.relative_to(kept).as_posix() for path in kept.rglob("*.*")} == {
        "drawn_home/bootifol/seed1/config.json",
        "drawn_home/bootifol/seed1/evaluations.csv",
        "drawn_home/bootifol/seed1/metrics.jsonl",
    }
    elsewhere = keeping(out=suite / "elsewhere")
    assert str(elsewhere.state(runs[0])) == "done: 240 agent steps, 12 s"
    assert str(elsewhere.work()) == "1 done, 1 failed, 0 left"
    assert calls(suite).count("train bootifol/seed1") == 1
    with pytest.raises(
        BootifolError, match=r"kept/drawn_home/bootifol/seed1 was begun with time_budget None"
    ):
        keeping(out=suite / "a third", time_budget="60s")


@pytest.mark.parametrize(
    ("exit_code", "printed", "sentence"),
    [
        (0, "whatever", ""),
        (2, "error: first\nerror: no such task\nstopped\n\n", "no such task"),
        (1, "Traceback\n  File x\nValueError: wrong\n", "ValueError: wrong"),
        (3, "", "exit code 3"),
        (-9, "", "killed by SIGKILL (is there enough memory?)"),
    ],
)
def test_what_went_wrong_is_one_line(tmp_path: Path, exit_code: int, printed: str, sentence: str) -> None:
    before = "error: of an earlier attempt\n"
    (tmp_path / "log").write_text(before + printed)
    assert what_went_wrong(exit_code, tmp_path / "log", len(before)) == sentence


def test_the_time_left_is_that_of_runs_alike(suite: Path) -> None:
    runs = [run for seed in (1, 2) for run in planned("bootifol", "environment", seed=seed)]
    waiting = queue(suite, runs)
    assert waiting._time_left(runs) is None
    for run, seconds in zip(runs, (100, 40, 30, 0), strict=True):
        directory = waiting.directory(run)
        directory.mkdir(parents=True)
        if run.seed == 1:
            write_config(directory, {"task": run.task, "method": run.system.method})
            write_end(directory, seconds)
        else:
            record_line = {"phase": "interactive", "agent_steps": 10, "seconds": seconds}
            (directory / "metrics.jsonl").write_text(json.dumps(record_line) + "\n")
    assert waiting._time_left(runs[2:]) == (100 - 30) + 40
