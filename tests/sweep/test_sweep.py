"""Sweeps on Ray, with whole runs of seconds: to the end, stopped, and on a machine that dies."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from tiny_sweeps import RUN, tiny_sweep, write_config, write_end

from bootifol.cli.main import main
from bootifol.errors import BootifolError
from bootifol.sweep.beside import Place
from bootifol.sweep.progress import Board, Job
from bootifol.sweep.run_state import run_state
from bootifol.sweep.sweep import _conclude, _require_machines, sweep
from bootifol.sweep.worker import Ending, Killed
from bootifol.training.checkpoint import newest_checkpoint

ray = pytest.importorskip("ray", reason="sweeps run on Ray (the extra sweep)")

LONG = "    interactive.agent_steps: 600\n    agent.replay_capacity: 400\n    checkpoint_minutes: 0.002\n"
"""Long enough to be interrupted, with checkpoints on the way."""
PATIENCE = 240
"""Seconds after which a test that waits gives up."""


def test_a_sweep_goes_past_failures_is_gone_on_with_and_read_by_tables(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tiny_sweep(tmp_path / "mine.yaml", demos, "[mine:Method, environment, random]")
    sweep = ["sweep", str(file), "--trust", "--cpus", "1"]

    assert main(sweep) == 1
    printed = capsys.readouterr()
    assert printed.out == "2 done, 1 failed, 0 left of 3 runs in runs/mine\n"
    failed = "no module mine for mine:Method"
    assert f"failed     drawn_home/mine.Method/seed1: there is {failed}" in printed.err
    assert "done       drawn_home/environment/seed1: 240 agent steps" in printed.err
    assert not [*tmp_path.rglob("*.running"), *tmp_path.rglob("*.lock")]

    assert main([*sweep, "--list"]) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert listed["drawn_home/environment/seed1"].startswith("done: 240 agent steps")
    assert failed in listed["drawn_home/mine.Method/seed1"]

    assert main([*sweep, "--only", "*/environment/*", "*/random/*"]) == 0
    assert capsys.readouterr() == ("2 done, 0 failed, 0 left of 2 runs in runs/mine\n", ""), (
        "nothing was begun"
    )

    assert main(["table", "runs/mine"]) == 0
    table = capsys.readouterr().out
    assert "True reward" in table and "Random" in table
    assert main(["report", "runs/mine/drawn_home/environment", "--out", "report.html"]) == 0
    assert (tmp_path / "report.html").is_file()


def test_what_is_wrong_is_said_before_ray_is_started(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ray, "init", lambda **_: pytest.fail("Ray was started"))
    file = tiny_sweep(tmp_path / "mine.yaml", Path("nowhere"), "bootifol")
    assert main(["sweep", str(file)]) == 2
    said = capsys.readouterr().err
    assert "videos are missing in nowhere: record them" in said
    assert "bootifol demos record --task drawn_home --out nowhere --episodes 1000 --agent-size 32" in said
    assert main(["sweep", str(file), "--only", "virl"]) == 2
    assert (
        "no run of the sweep matches virl; names are like drawn_home/bootifol/seed1"
        in capsys.readouterr().err
    )
    assert main(["sweep", str(file), "--cpus", "2", "--address", "auto"]) == 2
    assert "leave one of them out" in capsys.readouterr().err
    write_config(tmp_path / "runs" / "mine" / RUN.name)
    tiny_sweep(file, demos, "bootifol")
    assert main(["sweep", str(file)]) == 2
    assert f"runs/mine/{RUN.name} was begun with" in capsys.readouterr().err


def test_a_sweep_that_is_done_needs_no_videos_and_no_ray(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ray, "init", lambda **_: pytest.fail("Ray was started"))
    write_config(tmp_path / "runs" / "mine" / RUN.name)
    write_end(tmp_path / "runs" / "mine" / RUN.name, 5.0)
    fields = ", ".join(f"{name}: {value}" for name, value in RUN.overrides)
    (tmp_path / "mine.yaml").write_text(
        f"{{tasks: drawn_home, presets: smoke, variants: {{default: {{{fields}}}}}}}"
    )
    assert main(["sweep", "mine.yaml"]) == 0


class Answers:
    """In place of Ray, with what it answers."""

    exceptions = ray.exceptions

    def __init__(self, answer: object = None) -> None:
        self.answer = answer

    def get(self, task: object) -> object:
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def nodes(self) -> list[dict[str, Any]]:
        return [
            {"Alive": True, "Resources": {"CPU": 2.0}},
            {"Alive": True, "Resources": {"CPU": 1.0, "GPU": 1.0}},
            {"Alive": False, "Resources": {"CPU": 64.0}},
        ]


@pytest.mark.parametrize(
    ("answer", "state", "error"),
    [
        (Ending(done=True), "done", ""),
        (Ending(), "begun", ""),
        (Ending(error="the loss is nan"), "failed", "the loss is nan"),
        (ray.exceptions.TaskCancelledError(), "begun", ""),
        (
            ray.exceptions.RayTaskError("work_on", "a traceback", Killed("killed by SIGKILL")),
            "failed",
            "killed by SIGKILL",
        ),
        (
            ray.exceptions.NodeDiedError("gone"),
            "failed",
            "its machine or its process there died 4 times (NodeDiedError)",
        ),
    ],
)
def test_what_ray_answers_becomes_the_runs_state(
    tmp_path: Path, answer: object, state: str, error: str
) -> None:
    job = Job(RUN, tmp_path / "seed1", run_state(tmp_path / "seed1"), pending=True)
    _conclude(Answers(answer), None, job, Board([job], Console(quiet=True)))
    assert (job.state.state, job.state.error, job.pending) == (state, error, False)
    assert run_state(tmp_path / "seed1").error == error


@pytest.mark.parametrize(("cpus", "gpus"), [(3, 0.0), (2, 1.0), (64, 0.0)])
def test_a_run_that_no_machine_can_take_is_refused(cpus: int, gpus: float) -> None:
    _require_machines(Answers(), [RUN, replace(RUN, cpus=1, gpus=0.5)])
    sentence = (
        rf"needs {cpus} cores and {gpus:g} GPUs, and no machine has them \(there are 2 and 0, 1 and 1\)"
    )
    with pytest.raises(BootifolError, match=sentence):
        _require_machines(Answers(), [RUN, replace(RUN, cpus=cpus, gpus=gpus)])


def test_a_cluster_that_is_not_there_gets_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def init(**_: object) -> None:
        raise ConnectionError("nobody listens")

    monkeypatch.setattr(ray, "init", init)
    with pytest.raises(BootifolError, match="Ray cannot be reached at auto: nobody listens"):
        sweep([replace(RUN, method="random")], tmp_path / "out", address="auto")
    assert not (tmp_path / "out").exists(), "nothing is left of it"


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A Ray cluster of one machine, which has one core, and to which others may be added."""
    from ray.cluster_utils import Cluster

    names = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_memory_monitor_refresh_ms": "0"}
    before = dict(os.environ)
    os.environ.update(names)
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        yield made
    finally:
        made.shutdown()
        os.environ.clear()
        os.environ.update(before)


@pytest.fixture
def begin(
    cluster: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[Path], subprocess.Popen[str]]]:
    """Begins a sweep on the cluster, in a process of its own."""
    monkeypatch.chdir(tmp_path)
    begun: list[subprocess.Popen[str]] = []

    def sweep(file: Path) -> subprocess.Popen[str]:
        words = ["sweep", str(file), "--address", cluster.address]
        with (tmp_path / "said").open("a") as said:
            begun.append(
                subprocess.Popen(
                    [sys.executable, "-m", "bootifol", *words], stdout=said, stderr=said, text=True
                )
            )
        return begun[-1]

    yield sweep
    for process in begun:
        if process.poll() is None:
            process.kill()
            process.wait()


def until(found: Callable[[], Any], process: subprocess.Popen[str]) -> Any:
    """What is found once it is there."""
    for _ in range(PATIENCE * 20):
        if value := found():
            return value
        assert process.poll() is None, Path("said").read_text()
        time.sleep(0.05)
    raise AssertionError(f"nothing came in {PATIENCE} seconds: {Path('said').read_text()}")


def where_it_acts(directory: Path) -> Place | None:
    """Where a run goes on that has acted for some episodes since its last checkpoint, which is not its first."""
    checkpoint = newest_checkpoint(directory / "checkpoints")
    saved = 0 if checkpoint is None else int(checkpoint.name.split("-")[0])
    return Place.of(directory) if 0 < saved < run_state(directory).agent_steps else None


def attempts(directory: Path) -> list[str]:
    log = directory.with_name(f"{directory.name}.log").read_text()
    return [" ".join(line.split()[1:4]) for line in log.splitlines() if line.startswith("$ ")]


def test_ctrl_c_lets_runs_write_checkpoints_and_the_same_command_goes_on(
    tmp_path: Path, demos: Path, begin: Callable[[Path], subprocess.Popen[str]]
) -> None:
    file = tiny_sweep(tmp_path / "mine.yaml", demos, "[environment, random]", LONG)
    first, second = (
        tmp_path / "runs" / "mine" / "drawn_home" / method / "seed1" for method in ("environment", "random")
    )
    sweep = begin(file)
    until(lambda: where_it_acts(first), sweep)
    sweep.send_signal(signal.SIGINT)
    assert sweep.wait(PATIENCE) == 130
    said = (tmp_path / "said").read_text()
    assert "stopped    drawn_home/environment/seed1: the same command goes on with it" in said
    assert "0 done, 0 failed, 2 left of 2 runs in runs/mine" in said
    assert any((first / "checkpoints").iterdir())
    assert not second.exists() and not [*tmp_path.rglob("*.running"), *tmp_path.rglob("*.lock")]

    sweep = begin(file)
    assert sweep.wait(PATIENCE) == 0, (tmp_path / "said").read_text()
    assert attempts(first) == ["bootifol train --method", "bootifol train --resume"]
    assert attempts(second) == ["bootifol random --task"]


def test_a_run_whose_machine_dies_goes_on_elsewhere_from_its_last_checkpoint(
    tmp_path: Path, demos: Path, cluster: Any, begin: Callable[[Path], subprocess.Popen[str]]
) -> None:
    machines = {node.node_id: node for node in (cluster.add_node(num_cpus=2), cluster.add_node(num_cpus=2))}
    file = tiny_sweep(tmp_path / "mine.yaml", demos, "environment", f"{LONG}cpus: 2\n")
    directory = tmp_path / "runs" / "mine" / "drawn_home" / "environment" / "seed1"
    sweep = begin(file)
    place = until(lambda: where_it_acts(directory), sweep)
    os.kill(place.pid, signal.SIGSTOP)  # as after a loss of power, it does nothing any more
    cluster.remove_node(machines[place.node], allow_graceful=False)
    os.kill(place.pid, signal.SIGKILL)

    assert sweep.wait(PATIENCE) == 0, (tmp_path / "said").read_text()
    said = (tmp_path / "said").read_text()
    assert "(it was killed where it was, or the machine died)" in said
    assert "1 done, 0 failed, 0 left of 1 runs" in said
    assert "(raylet)" not in said, "what Ray says is kept elsewhere"
    assert attempts(directory) == ["bootifol train --method", "bootifol train --resume"]
    log = directory.with_name("seed1.log").read_text()
    resumed = next(line for line in log.splitlines() if line.startswith("resuming"))
    assert int(resumed.split(" and ")[1].split()[0]) > 0, "not from its beginning"
    lines = [json.loads(line) for line in (directory / "metrics.jsonl").read_text().splitlines()]
    steps = [line["agent_steps"] for line in lines if "agent/q" in line]
    assert steps == sorted(set(steps)) and steps[-1] == 600, "nothing stands there twice"
