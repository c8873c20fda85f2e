"""A run that stops and goes on is bit for bit the run that never stopped."""

from __future__ import annotations

import csv
import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_runs import ENDS_SOON, RUNS, TINY, WITH_DEMONSTRATIONS, NoFurther, new_run, no_further, resumed

from bootifol.agents.drqv2 import DrQv2
from bootifol.errors import BootifolError
from bootifol.evaluation.tables import EvaluationRow, RankingRow, append_evaluations, append_ranking
from bootifol.files import read_arrays, read_json
from bootifol.training.checkpoint import newest_checkpoint
from bootifol.training.config import TrainingConfig
from bootifol.training.evaluator import Evaluator
from bootifol.training.inferred_demonstrations import Demonstrations
from bootifol.training.interactive import InteractivePhase
from bootifol.training.trainer import Trainer
from bootifol.types import StepMetrics


def signal_at(monkeypatch: pytest.MonkeyPatch, number: signal.Signals, episode: int) -> None:
    """Sends this process a signal while episode `episode` is being played."""
    play = InteractivePhase.play_episode

    def play_and_signal(self: InteractivePhase) -> list[StepMetrics]:
        if self.counters.episodes == episode:
            os.kill(os.getpid(), number)
        return play(self)

    monkeypatch.setattr(InteractivePhase, "play_episode", play_and_signal)


def interrupt_at_call(monkeypatch: pytest.MonkeyPatch, owner: type, name: str, call: int) -> None:
    """Sends this process Ctrl-C when a method is called for the `call`th time."""
    method, calls = getattr(owner, name), []

    def interrupting(*arguments: object) -> object:
        calls.append(arguments)
        if len(calls) == call:
            os.kill(os.getpid(), signal.SIGINT)
        return method(*arguments)

    monkeypatch.setattr(owner, name, interrupting)


def test_a_run_stopped_while_cloning_goes_on_where_it_was(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = new_run(tmp_path / "whole", demos, config=WITH_DEMONSTRATIONS)
    assert whole.learn()

    with monkeypatch.context() as patch:
        interrupt_at_call(patch, Demonstrations, "learn_inverse_dynamics", call=2)
        first = new_run(tmp_path / "parts", demos, config=WITH_DEMONSTRATIONS)
        assert not first.learn()
    assert (first.counters.cloning_steps, first.counters.cloning_gradient_steps) == (2, 2)
    with monkeypatch.context() as patch:
        interrupt_at_call(patch, Demonstrations, "infer", call=2)
        second = resumed(tmp_path / "parts")
        assert not second.learn()
    assert (second.counters.cloning_steps, second.counters.cloning_gradient_steps) == (3 + 2, 3)
    with monkeypatch.context() as patch:
        interrupt_at_call(patch, DrQv2, "clone", call=3)
        third = resumed(tmp_path / "parts")
        assert not third.learn()
    assert (third.counters.cloning_steps, third.counters.cloning_gradient_steps) == (3 + 4 + 3, 3 + 3)
    rest = resumed(tmp_path / "parts")
    assert rest.learn()
    assert_same_checkpoint(tmp_path / "whole", tmp_path / "parts")


def assert_same_checkpoint(one: Path, other: Path) -> None:
    first, second = newest_checkpoint(one / "checkpoints"), newest_checkpoint(other / "checkpoints")
    assert first is not None and second is not None and first.name == second.name
    for file in sorted(first.glob("*.safetensors")):
        a, b = read_arrays(file, file.name), read_arrays(second / file.name, file.name)
        assert a.keys() == b.keys()
        for name in a:
            np.testing.assert_array_equal(a[name], b[name], err_msg=f"{file.name}: {name}")
    a, b = (read_json(path / "checkpoint.json", "") for path in (first, second))
    assert a["random_state"] == b["random_state"]
    seconds = {name for name in a["counters"] if "seconds" in name}
    for name in a["counters"].keys() - seconds:
        assert a["counters"][name] == b["counters"][name], name


def next_actions(run: Trainer) -> np.ndarray:
    observation, _ = run.parts.environment.reset(seed=5)
    return np.stack([run.parts.agent.act(observation, 240, explore=True) for _ in range(3)])


@pytest.mark.parametrize(("method", "config"), RUNS)
def test_a_run_stopped_and_resumed_is_the_uninterrupted_run(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch, method: str, config: TrainingConfig
) -> None:
    whole = new_run(tmp_path / "whole", demos, method, config)
    assert whole.learn()

    with monkeypatch.context() as patch:
        signal_at(patch, signal.SIGTERM, episode=4)
        assert not new_run(tmp_path / "parts", demos, method, config).learn()
    rest = resumed(tmp_path / "parts")
    assert (rest.counters.episodes, rest.interactive.steps_in_progress) == (4, 1), (
        "after a step, not an episode"
    )
    assert rest.learn()

    assert_same_checkpoint(tmp_path / "whole", tmp_path / "parts")
    np.testing.assert_array_equal(next_actions(whole), next_actions(rest))


def metrics_of(run: Path) -> list[dict[str, object]]:
    """What was logged, without times and without what means of an interrupted line differ in."""
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    kept = ("phase", "gradient_step", "agent_steps")
    return [
        {k: v for k, v in line.items() if k in kept or k.startswith(("evaluation", "ranking"))}
        for line in lines
    ]


def test_stops_at_any_moment_leave_the_uninterrupted_run(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In alignment, while ranking, within episodes, warm-up included, and within an evaluation."""
    whole = new_run(tmp_path / "whole", demos, config=WITH_DEMONSTRATIONS)
    assert whole.learn()

    new_run(tmp_path / "parts", demos, config=WITH_DEMONSTRATIONS)
    moments = [
        (Trainer, "_checkpoint_if_due", 4),
        (Evaluator, "rank", 1),
        (InteractivePhase, "_update_agent", 17),
        (InteractivePhase, "_update_agent", 25),
        (DrQv2, "clone", 4),
        (Evaluator, "_play", 1),
        (InteractivePhase, "_update_agent", 30),
        (Evaluator, "_play", 2),
        (InteractivePhase, "_update_agent", 40),
    ]
    for owner, name, call in moments:
        with monkeypatch.context() as patch:
            interrupt_at_call(patch, owner, name, call)
            assert not resumed(tmp_path / "parts").learn()
    rest = resumed(tmp_path / "parts")
    assert rest.learn()
    assert_same_checkpoint(tmp_path / "whole", tmp_path / "parts")
    np.testing.assert_array_equal(next_actions(whole), next_actions(rest))
    assert metrics_of(tmp_path / "parts") == metrics_of(tmp_path / "whole")
    for table in ("evaluations.csv", "ranking.csv"):
        rows = [
            [cell for number, cell in enumerate(row) if number != 1]  # all but the seconds
            for row in csv.reader((tmp_path / "parts" / table).read_text().splitlines())
        ]
        assert rows == [
            [cell for number, cell in enumerate(row) if number != 1]
            for row in csv.reader((tmp_path / "whole" / table).read_text().splitlines())
        ]


def test_an_environment_that_fails_loses_nothing(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = new_run(tmp_path / "whole", demos)
    assert whole.learn()
    run = new_run(tmp_path / "parts", demos)
    step, calls = run.parts.environment.simulator.step, []

    def failing(action: np.ndarray) -> object:
        calls.append(action)
        if len(calls) == 100:
            raise ZeroDivisionError("the arm fell off")
        return step(action)

    monkeypatch.setattr(run.parts.environment.simulator, "step", failing)
    with pytest.raises(
        BootifolError, match=r"the arm fell off \(ZeroDivisionError in test_resume.py.*--resume"
    ):
        run.learn()
    rest = resumed(tmp_path / "parts")
    assert rest.counters.agent_steps == 99
    assert rest.learn()
    assert_same_checkpoint(tmp_path / "whole", tmp_path / "parts")


def test_a_run_goes_on_with_another_name_of_the_device(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    whole = new_run(tmp_path / "whole", demos)
    assert whole.learn()

    with monkeypatch.context() as patch:
        signal_at(patch, signal.SIGTERM, episode=2)
        assert not new_run(tmp_path / "parts", demos, config=replace(TINY, device="auto")).learn()
    path = tmp_path / "parts" / "config.json"
    path.write_text(path.read_text().replace('"device": "auto"', '"device": "cpu"'))
    rest = resumed(tmp_path / "parts")
    assert rest.config.training.device == "cpu"
    assert rest.learn()
    assert_same_checkpoint(tmp_path / "whole", tmp_path / "parts")


def test_ctrl_c_during_alignment_can_be_resumed(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = new_run(tmp_path / "whole", demos)
    assert whole.learn()

    run = new_run(tmp_path / "parts", demos)
    step = run.parts.reward_model._step

    def step_and_signal(*arguments: object, **named: object) -> object:
        os.kill(os.getpid(), signal.SIGINT)
        return step(*arguments, **named)

    monkeypatch.setattr(run.parts.reward_model, "_step", step_and_signal)
    assert not run.learn()
    rest = resumed(tmp_path / "parts")
    assert rest.counters.alignment_steps == 1
    assert rest.learn()
    assert_same_checkpoint(tmp_path / "whole", tmp_path / "parts")


def test_what_was_measured_after_the_checkpoint_is_undone_once_the_run_goes_on(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    signal_at(monkeypatch, signal.SIGTERM, episode=4)
    assert not new_run(tmp_path / "run", demos).learn()
    files = [tmp_path / "run" / name for name in ("metrics.jsonl", "evaluations.csv", "ranking.csv")]
    written = [file.read_text() for file in files]
    with files[0].open("a") as file:
        file.write('{"phase": "interactive", "agent_steps": 99999}\n')
    # With a time budget a run may end before the moments that it had come to in its last session.
    append_evaluations(files[1], [EvaluationRow(99999, 9.0, 60, 0, 7, 1.0, 1.0, True)])
    append_ranking(files[2], [RankingRow(99999, "expert", "a", 1.0)])
    there = [file.read_text() for file in files]
    rest = resumed(tmp_path / "run")
    assert [file.read_text() for file in files] == there, "looking at a run changes nothing"
    monkeypatch.setattr(Trainer, "_align", no_further)
    with pytest.raises(NoFurther):
        rest.learn()
    assert [file.read_text() for file in files] == written
    assert "120" in written[1] and written[2].count("\n") > 1


def test_metrics_of_a_run_that_died_before_its_first_checkpoint_are_undone(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new_run(tmp_path / "run", demos)
    (tmp_path / "run" / "metrics.jsonl").write_text('{"phase": "alignment", "gradient_step": 2}\n')
    monkeypatch.setattr(Trainer, "_align", no_further)
    with pytest.raises(NoFurther):
        resumed(tmp_path / "run").learn()
    assert (tmp_path / "run" / "metrics.jsonl").read_text() == ""


def test_a_full_disk_during_a_checkpoint_leaves_the_last_good_one(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = new_run(tmp_path / "whole", demos)
    assert whole.learn()

    with monkeypatch.context() as patch:

        def no_space(*arguments: object) -> None:
            raise OSError(28, "No space left on device")

        run = new_run(tmp_path / "parts", demos)
        play = InteractivePhase.play_episode

        def play_and_fill(self: InteractivePhase) -> list[StepMetrics]:
            metrics = play(self)
            if self.counters.episodes == 2:
                patch.setattr("bootifol.files.save_file", no_space)
                os.kill(os.getpid(), signal.SIGTERM)
            return metrics

        patch.setattr(InteractivePhase, "play_episode", play_and_fill)
        with pytest.raises(BootifolError, match=r"No space left on device.*train --resume"):
            run.learn()

    assert [path.name for path in (tmp_path / "parts" / "checkpoints").iterdir()] == [
        "000000000000-000000004"
    ]
    rest = resumed(tmp_path / "parts")
    assert rest.learn()
    assert_same_checkpoint(tmp_path / "whole", tmp_path / "parts")


def test_what_lies_beside_checkpoints_is_left_alone_but_what_a_killed_process_wrote(
    tmp_path: Path, demos: Path
) -> None:
    checkpoints = tmp_path / "run" / "checkpoints"
    for name in ("best_so_far", "zzz", ".000000000060-000000004.0123abcd.tmp"):
        (checkpoints / name).mkdir(parents=True)
    assert new_run(tmp_path / "run", demos, config=ENDS_SOON).learn()
    newest = newest_checkpoint(checkpoints)
    assert newest is not None
    assert {path.name for path in checkpoints.iterdir()} == {"best_so_far", "zzz", newest.name}
    assert newest.name == "000000000090-000000004"


@pytest.mark.parametrize(
    "index",
    [
        "[]",
        "{}",
        '{"format": 2}',
        '{"format": 2, "counters": {"hops": 1}, "random_state": {}, "metrics_bytes": 0}',
    ],
)
def test_a_damaged_index_of_a_checkpoint_is_named(tmp_path: Path, demos: Path, index: str) -> None:
    assert new_run(tmp_path / "run", demos, config=ENDS_SOON).learn()
    newest = newest_checkpoint(tmp_path / "run" / "checkpoints")
    assert newest is not None
    (newest / "checkpoint.json").write_text(index)
    with pytest.raises(BootifolError, match="is damaged or of another version of bootifol"):
        resumed(tmp_path / "run")


def test_a_checkpoint_of_an_older_format_is_told_so(tmp_path: Path, demos: Path) -> None:
    assert new_run(tmp_path / "run", demos, config=ENDS_SOON).learn()
    newest = newest_checkpoint(tmp_path / "run" / "checkpoints")
    assert newest is not None
    (newest / "checkpoint.json").write_text('{"format": 1, "counters": {"inferred_videos": 1}}')
    with pytest.raises(BootifolError, match="was written in checkpoint format 1, this version reads 2"):
        resumed(tmp_path / "run")


def test_a_replay_smaller_than_an_episode_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    config = replace(TINY, agent=replace(TINY.agent, replay_capacity=20))
    with pytest.raises(BootifolError, match=r"agent.replay_capacity is 20 frames, and one episode has 31"):
        new_run(tmp_path / "run", tmp_path / "no_demos", config=config)


def test_a_truncated_checkpoint_is_named(
    tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    signal_at(monkeypatch, signal.SIGTERM, episode=1)
    assert not new_run(tmp_path / "run", demos).learn()
    checkpoint = newest_checkpoint(tmp_path / "run" / "checkpoints")
    assert checkpoint is not None
    agent = checkpoint / "agent.safetensors"
    agent.write_bytes(agent.read_bytes()[:-100])
    with pytest.raises(
        BootifolError, match=r"the checkpoint's agent is damaged or incomplete: .*agent\.safetensors"
    ):
        resumed(tmp_path / "run")
