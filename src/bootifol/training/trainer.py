"""A run from its first step to its report: the paper's Algorithm 1, with checkpoints.

What happens, in order, is `Trainer.run` and `Trainer.learn`. What a phase does is in `alignment.py`, `cloning.py` and
`interactive.py`; `_drive` takes their steps. What is measured on the way is in `evaluator.py`.
"""

from __future__ import annotations

import shlex
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console

from bootifol.devices import chosen_device
from bootifol.errors import BootifolError, EnvironmentFailed
from bootifol.evaluation.tables import drop_later_rows
from bootifol.malloc import keep_freed_memory
from bootifol.plugins import imports_code
from bootifol.progress import progress
from bootifol.reports.html import report
from bootifol.rewards.registry import check_method
from bootifol.tracking import COUNTS, Averages, RunLog, Tracker, cut_metrics, make_tracker, require_tracker
from bootifol.training.alignment import alignment_phase
from bootifol.training.budget import Budget, Counters, PhaseStep, Stopwatch
from bootifol.training.build import build_parts
from bootifol.training.callbacks import Callback, Callbacks
from bootifol.training.checkpoint import (
    Progress,
    load_checkpoint,
    newest_checkpoint,
    restore_generator,
    save_checkpoint,
)
from bootifol.training.cloning import cloning_phase, steps_of_a_phase
from bootifol.training.evaluator import Evaluator
from bootifol.training.forecast import forecast
from bootifol.training.interactive import InteractivePhase
from bootifol.training.interruption import Interruption, Stopped
from bootifol.training.run_config import RunConfig
from bootifol.training.saved_policy import save_policy
from bootifol.types import Metrics


class Trainer:
    """Trains a run, or goes on with one from its newest checkpoint.

    Args:
        config: what the run is.
        directory: where it writes.
        console: where messages go.
        callbacks: a user's code, which is told what happens.

    Raises:
        BootifolError: the configuration, the demos or the checkpoint cannot be used.
    """

    def __init__(
        self, config: RunConfig, directory: Path, console: Console, callbacks: Sequence[Callback] = ()
    ) -> None:
        self.config, self.directory, self.console = config, directory, console
        self.callbacks = Callbacks(callbacks)
        training = config.training
        torch.set_num_threads(training.threads)
        keep_freed_memory()
        self.task = config.resolved_task()
        check_method(config.method)
        require_tracker(training.tracker)
        device = chosen_device(training.device)
        if device != "cpu":
            console.print(f"computing on {device}, which has not been tried yet; --device cpu has")
        self.parts = build_parts(config, self.task, console)
        self.counters = Counters()
        self.rng = np.random.default_rng([config.seed, 3])
        self.interruption = Interruption()
        self._tracker: Tracker | None = None
        self._averages: dict[str, Averages] = defaultdict(Averages)
        self._metrics_bytes = 0
        self._ended = False
        checkpoint = self._newest_checkpoint()
        if checkpoint is not None:
            self._resume(checkpoint)
        self.budget = Budget(
            training.interactive.agent_steps,
            config.time_budget,
            training.alignment.gradient_steps,
            training.alignment.time_fraction,
            training.demonstrations.time_fraction / training.demonstrations.phases,
        )
        self.interactive = InteractivePhase(
            self.parts,
            training.interactive,
            self.budget,
            self.counters,
            config.seed,
            self.rng,
            self.interruption,
        )
        if checkpoint is not None and (checkpoint / "episode.safetensors").exists():
            load_checkpoint(checkpoint, {"episode": self.interactive})
        self.evaluator = Evaluator(
            config,
            directory,
            self.parts,
            self.budget,
            self.counters,
            console,
            partial(self._log, "interactive"),
            self.interruption,
        )
        self._saved_at = time.monotonic()

    def run(self) -> bool:
        """Learns, measures what was learned, and writes the report.

        Returns:
            True when the run has ended; False when it was asked to stop and can be resumed.

        Raises:
            BootifolError: an error that the run can be resumed from, which its sentence says.
        """
        finished = False
        try:
            finished = self.learn() and self._finish_and_report()
        finally:
            self.callbacks("on_end", finished)
        return finished

    def learn(self) -> bool:
        """Algorithm 1: both loops.

        Returns:
            True when they have ended; False when the run was asked to stop and can be resumed.
        """
        self._begin()
        with self.interruption, self._saying_how_to_resume():
            try:
                self._tell("on_start", self.directory)
                if self._newest_checkpoint() is None:
                    self._checkpoint()
                # Alignment Phase: f, g, q and d learn from D_e and from videos of a random policy.
                self._align()
                # Interactive Phase: the agent acts and learns, its videos teach f and g.
                self._forecast()
                self._evaluate_if_due()
                while self.interactive.in_progress or not self.budget.ended(self.counters):
                    if self.interactive.cloning_due:
                        # Beyond the paper: actions are inferred for expert videos, and the policy is their clone.
                        self._clone()
                    else:
                        self._act_and_learn()
                self._tell_what_was_done()
                self._checkpoint()
                return True
            except Stopped:
                self._checkpoint()
                self.log.close()
                self.console.print(f"stopped after a checkpoint. {self.how_to_resume()}")
                return False

    def finish(self) -> Metrics:
        """The measurements of a run that has ended: final returns, ranking, showcase.

        Returns:
            The final returns by name.

        Raises:
            Stopped: it was asked to stop, and goes on with these measurements when it is resumed.
        """
        self._ended = True
        with self.interruption:
            try:
                self.parts.demos.verification.wait()
                returns = self.evaluator.final_returns()
                self.callbacks("on_evaluation", self.counters.agent_steps, returns)
                self.evaluator.rank()
                self.evaluator.sample_episodes()
            except Exception:
                self.log.close()
                raise
        return returns

    def how_to_resume(self) -> str:
        """The command that goes on with the run."""
        if self._newest_checkpoint() is None:
            return f"There is no checkpoint yet in {self.directory}: start again"
        trust = " --trust" if imports_code(self.config.task) or imports_code(self.config.method) else ""
        return f"Go on from the last checkpoint with: bootifol train --resume {shlex.quote(str(self.directory))}{trust}"

    def begin_tracker(self) -> None:
        """Begins the tracker, if it has not begun: of a new run before `config.json` is written, for it may refuse.

        Raises:
            BootifolError: it refuses, and has left nothing.
        """
        if self._tracker is not None:
            return
        name = self.config.training.tracker
        if name == "wandb":
            self.console.print(
                "metrics, videos and the report go to Weights & Biases, too, as the configuration says (tracker wandb)"
            )
        self._tracker = make_tracker(name, self.directory, asdict(self.config))

    def _align(self) -> None:
        """Takes the gradient steps of alignment that are left, and ranks held-out videos after the last."""
        counters, parts = self.counters, self.parts
        if not (self.budget.alignment_ended(counters) or counters.agent_steps):
            counters.to_rank = 1
            steps = alignment_phase(
                parts.reward_model,
                parts.demos.expert,
                parts.demos.random,
                self.budget,
                counters,
                self.config.training.alignment.log_every,
            )
            self._drive("alignment", "aligning the reward", *self.budget.alignment_extent(counters), steps)
            if rest := self._averages["alignment"].pop():
                self._log("alignment", counters.alignment_steps, rest)
            if not counters.alignment_steps:
                self.console.print(
                    "nothing to align: this method's reward learns nothing before the agent acts"
                )
        if counters.to_rank:
            self.evaluator.rank()
            counters.to_rank = 0
            self._checkpoint()

    def _clone(self) -> None:
        """Takes the steps of a Cloning Phase that are left, and evaluates the clone where there is one."""
        counters, parts = self.counters, self.parts
        assert parts.demonstrations is not None
        total = steps_of_a_phase(parts.demonstrations)
        done = counters.cloning_steps % total
        steps = cloning_phase(
            parts.agent,
            parts.demonstrations,
            parts.replay,
            parts.reward_model,
            self.rng,
            self.budget,
            counters,
            self.config.training.interactive.log_every,
        )
        clones = parts.demonstrations.config.clones
        what = "cloning the videos" if clones else "inferring the videos' actions"
        self._drive("cloning", what, "steps", done, total, steps)
        watch = Stopwatch()
        if clones:
            counters.to_evaluate = 1
            self._evaluate_if_due()
            self._checkpoint()
        counters.cloning_seconds += watch.lap()

    def _act_and_learn(self) -> None:
        """Plays episodes until the run's end, or until a Cloning Phase is due."""
        extent = self.budget.interactive_extent(self.counters)
        self._drive("interactive", "acting and learning", *extent, self.interactive.steps())

    def _drive(
        self, phase: str, description: str, unit: str, done: int, total: int, steps: Iterator[PhaseStep]
    ) -> None:
        """Takes the steps of a phase: shows, logs and evaluates, and checkpoints now and then.

        Args:
            phase: "alignment", "cloning" or "interactive".
            description: for the progress bar.
            unit: of the bar.
            done: of the bar's units, before the first step.
            total: the bar's units.
            steps: of the phase.

        Raises:
            Stopped: the run was asked to stop.
        """
        averages = self._averages[phase]
        with progress(description, total, done, unit) as advance:
            for step in steps:
                for metrics in step.metrics:
                    averages.add(metrics)
                means: Metrics = {}
                if step.log_is_due:
                    means = averages.pop()
                    self._log(phase, step.count, means)
                if phase == "interactive":
                    self._evaluate_now_and_then()
                before, done = done, min(step.done, total)
                advance(done - before, **self._beside_the_bar(phase, means))
                self.interruption.stop_if_requested()
                self._checkpoint_if_due()

    def _beside_the_bar(self, phase: str, means: Metrics) -> dict[str, float]:
        if phase == "alignment":
            return {"loss": means["loss/total"]} if "loss/total" in means else {}
        if phase == "cloning":
            return dict(means)
        newest = self.evaluator.newest.items()
        short = {name.removeprefix("evaluation/"): value for name, value in newest}
        return {"agent_steps": self.counters.agent_steps, **short}

    def _evaluate_now_and_then(self) -> None:
        counters, every = self.counters, self.config.training.evaluation.every
        if counters.agent_steps // every > counters.evaluations:
            counters.evaluations = counters.agent_steps // every
            counters.to_evaluate = 1
            self._evaluate_if_due()

    def _evaluate_if_due(self) -> None:
        if self.counters.to_evaluate:
            self.evaluator.returns_on_the_way()
            self.counters.to_evaluate = 0
            if self.evaluator.newest:
                self._tell("on_evaluation", self.counters.agent_steps, self.evaluator.newest)

    def _forecast(self) -> None:
        """Says what a time budget buys, before the agent's first step."""
        if self.config.time_budget is not None and self.counters.agent_steps == 0:
            bought = forecast(self.config, self.parts, self.budget, self.counters)
            self.console.print(bought.in_words(), style="bold red" if bought.little else None)

    def _tell_what_was_done(self) -> None:
        counters = self.counters
        frames = counters.agent_steps * self.task.action_repeat
        self.console.print(
            f"{counters.agent_steps:,} agent steps ({frames:,} environment frames), {counters.agent_updates:,} "
            f"updates of the agent and {counters.reward_updates:,} of the reward, after "
            f"{counters.alignment_steps:,} of alignment"
        )

    def _finish_and_report(self) -> bool:
        try:
            self.finish()
        except Stopped:
            self.console.print(f"stopped before its last measurements. {self.how_to_resume()}")
            return False
        page = report([self.directory], self.directory / "report.html")
        self.log.report(page, sorted((self.directory / "videos").glob("*.mp4")))
        self.log.close()
        self.console.print(f"report: {page}")
        return True

    def _log(self, phase: str, count: int, metrics: Metrics) -> None:
        self.log.log(phase, COUNTS[phase], count, self.counters.seconds, metrics)
        self._tell("on_log", phase, count, metrics)

    def _tell(self, event: str, *arguments: Any) -> None:
        """Calls the callbacks; who raises `StopTraining` while the run learns has it stopped after this step."""
        stop = self.callbacks(event, *arguments)
        if stop is not None and not self._ended:
            self.interruption.requested = True
            self.console.print(f"a callback stops the run: {stop}".removesuffix(": "))

    def _newest_checkpoint(self) -> Path | None:
        return newest_checkpoint(self.directory / "checkpoints")

    def _resume(self, checkpoint: Path) -> None:
        """Takes over what a checkpoint holds, all but an episode in progress."""
        saved = load_checkpoint(checkpoint, self.parts.stateful())
        self.counters = saved.counters
        self.rng = restore_generator(saved.random_state)
        self._metrics_bytes = saved.metrics_bytes
        self.console.print(
            f"resuming {self.directory} after {self.counters.alignment_steps:,} alignment steps and "
            f"{self.counters.agent_steps:,} agent steps"
        )

    def _begin(self) -> None:
        """Undoes what followed the checkpoint, and opens the log. Not in `__init__`, for benchmarks open runs that are
        in progress."""
        missing = cut_metrics(self.directory / "metrics.jsonl", self._metrics_bytes)
        if missing:
            self.console.print(
                f"metrics.jsonl lacks {missing:,} bytes of what was logged before the checkpoint"
            )
        drop_later_rows(self.directory, self.counters.agent_steps)
        if self._newest_checkpoint() is not None:
            RunConfig.note_resumed(self.directory, self.counters.agent_steps)
        self.begin_tracker()
        self.log = RunLog(self.directory, self._tracker)

    def _checkpoint_if_due(self) -> None:
        self.parts.demos.verification.check()
        if time.monotonic() - self._saved_at > 60 * self.config.training.checkpoint_minutes:
            self._checkpoint()

    def _checkpoint(self) -> None:
        self._metrics_bytes = self.log.bytes_written()
        components = self.parts.stateful()
        if self.interactive.in_progress:
            components["episode"] = self.interactive
        state = Progress(self.counters, dict(self.rng.bit_generator.state), self._metrics_bytes)
        written = save_checkpoint(self.directory / "checkpoints", state, components)
        save_policy(self.directory, self.config, self.parts, self.counters.agent_steps)
        self._saved_at = time.monotonic()
        self._tell("on_checkpoint", written)

    @contextmanager
    def _saying_how_to_resume(self) -> Iterator[None]:
        """Errors end with the command that goes on; what was learned before an environment failed is kept."""
        try:
            yield
        except EnvironmentFailed as failed:
            try:
                self._checkpoint()
            except BootifolError as error:
                raise BootifolError(f"{failed}; and {error}. {self.how_to_resume()}") from failed
            raise BootifolError(f"{failed}. {self.how_to_resume()}") from failed
        except BootifolError as error:
            raise BootifolError(f"{error}. {self.how_to_resume()}") from error
        except Exception:
            self.log.close()
            raise
