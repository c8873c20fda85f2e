"""A run from its first step to its report: Alignment Phase, Interactive Phase, evaluation.

What happens, in order, is `Run.learn` and `Run.finish`; what a phase does is in `alignment.py`, `cloning.py` and
`interactive.py`, and what is measured on the way in `evaluator.py`.
"""

from __future__ import annotations

import shlex
import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console

from bootifol.demos.augmentation import augmented
from bootifol.devices import chosen_device
from bootifol.errors import BootifolError, EnvironmentFailed
from bootifol.evaluation.tables import drop_later_rows
from bootifol.malloc import keep_freed_memory
from bootifol.plugins import imports_code
from bootifol.progress import progress
from bootifol.rewards.registry import check_method
from bootifol.tracking import Averages, RunLog, Tracker, cut_metrics, make_tracker, require_tracker
from bootifol.training.alignment import alignment_phase
from bootifol.training.budget import Budget, Counters, Stopwatch
from bootifol.training.build import build_components, build_environment, build_learners, open_demos
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


class Run:
    """A run in progress.

    Args:
        run: what it is.
        directory: where it writes; its newest checkpoint is gone on from, if there is one.
        console: where messages go.
        callbacks: a user's code, which is told what happens.

    Raises:
        BootifolError: the configuration, the demos or the checkpoint cannot be used.
    """

    def __init__(
        self, run: RunConfig, directory: Path, console: Console, callbacks: Sequence[Callback] = ()
    ) -> None:
        self.run = run
        self.directory = directory
        self.console = console
        self.callbacks = Callbacks(callbacks)
        config = self.run.training
        torch.set_num_threads(config.threads)
        keep_freed_memory()
        self.task = self.run.resolved_task()
        check_method(self.run.method)
        require_tracker(config.tracker)
        device = chosen_device(config.device)
        if device != "cpu":
            self.console.print(f"computing on {device}, which has not been tried yet; --device cpu has")
        self.environment = build_environment(self.run, self.task.episode_steps)
        learners = build_learners(self.run, self.environment)
        self.demos = open_demos(self.run, learners.backbone, self.console)
        self.components = build_components(
            self.run, self.environment, learners, self.demos.expert, self.console
        )
        self.counters = Counters()
        self.rng = np.random.default_rng([self.run.seed, 3])
        self.interruption = Interruption()
        self._tracker: Tracker | None = None
        self._metrics_bytes = 0
        self._ended = False
        checkpoint = self._resume()
        self.budget = Budget(
            config.interactive.agent_steps,
            self.run.time_budget,
            config.alignment.gradient_steps,
            config.alignment.time_share,
            config.demonstrations.time_share / config.demonstrations.phases,
        )
        self.interactive = InteractivePhase(
            environment=self.environment,
            expert=self.demos.expert,
            agent_videos=self.components.agent_videos,
            replay=self.components.replay,
            reward_model=self.components.reward_model,
            agent=self.components.agent,
            demonstrations=self.components.demonstrations,
            config=config.interactive,
            budget=self.budget,
            counters=self.counters,
            seed=self.run.seed,
            rng=self.rng,
            featurizer=self.components.featurizer,
            augmentation=self.demos.augmentation,
            stopping=lambda: self.interruption.requested,
        )
        if checkpoint is not None and (checkpoint / "episode.safetensors").exists():
            load_checkpoint(checkpoint, {"episode": self.interactive})
        self.evaluator = Evaluator(
            run=self.run,
            directory=self.directory,
            demos=self.demos,
            environment=self.environment,
            components=self.components,
            budget=self.budget,
            counters=self.counters,
            console=self.console,
            log=partial(self._log, "interactive", "agent_steps"),
            stop_if_requested=self.interruption.stop_if_requested,
        )
        self._saved_at = time.monotonic()

    def begin_tracker(self) -> None:
        """Begins the tracker, if it has not begun: of a new run before `config.json` is written, for it may refuse.

        Raises:
            BootifolError: it refuses, and has left nothing.
        """
        if self._tracker is not None:
            return
        name = self.run.training.tracker
        if name == "wandb":
            self.console.print(
                "metrics, videos and the report go to Weights & Biases, too, as the configuration says (tracker wandb)"
            )
        self._tracker = make_tracker(name, self.directory, asdict(self.run))

    def learn(self) -> bool:
        """Both phases.

        Returns:
            True when the run has ended; False when it was asked to stop and can be resumed.
        """
        self._undo_what_followed_the_checkpoint()
        if newest_checkpoint(self.directory / "checkpoints") is not None:
            RunConfig.note_resumed(self.directory, self.counters.agent_steps)
        self.begin_tracker()
        self.log = RunLog(self.directory, self._tracker)
        with self.interruption as interruption:
            try:
                self._tell("on_start", self.directory)
                if newest_checkpoint(self.directory / "checkpoints") is None:
                    self._checkpoint()
                return self._align(interruption) and self._interact(interruption)
            except Stopped:
                return self._stop()
            except EnvironmentFailed as error:
                self._checkpoint_unless(error)
                raise BootifolError(f"{error}. {self.how_to_resume()}") from error
            except BootifolError as error:
                raise BootifolError(f"{error}. {self.how_to_resume()}") from error
            except Exception:
                self.log.close()
                raise

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
                self.demos.verification.wait()
                returns = self.evaluator.final_returns()
                self.callbacks("on_evaluation", self.counters.agent_steps, returns)
                self.evaluator.rank()
                self.evaluator.sample_episodes()
            except Exception:
                self.log.close()
                raise
        return returns

    def publish(self, page: Path) -> None:
        """Shows the tracker the report and the videos of a run that has ended, and closes the log."""
        self.log.report(page, sorted((self.directory / "videos").glob("*.mp4")))
        self.log.close()

    def how_to_resume(self) -> str:
        """The command that goes on with the run."""
        if newest_checkpoint(self.directory / "checkpoints") is None:
            return f"There is no checkpoint yet in {self.directory}: start again"
        trust = " --trust" if imports_code(self.run.task) or imports_code(self.run.method) else ""
        return f"Go on from the last checkpoint with: bootifol train --resume {shlex.quote(str(self.directory))}{trust}"

    def _align(self, interruption: Interruption) -> bool:
        if not (self.budget.alignment_ended(self.counters) or self.counters.agent_steps):
            self.counters.to_rank = 1
            if not self._take_alignment_steps(interruption):
                return False
        if self.counters.to_rank:
            self.evaluator.rank()
            self.counters.to_rank = 0
            self._checkpoint()
        return True

    def _take_alignment_steps(self, interruption: Interruption) -> bool:
        config = self.run.training.alignment
        averages = Averages()
        model = self.components.reward_model
        shown: dict[str, float] = {}
        unit, done, total = self.budget.alignment_extent(self.counters)
        with progress("aligning the reward", total, done, unit) as advance:
            expert, random = (
                augmented(videos, self.demos.augmentation)
                for videos in (self.demos.expert, self.demos.random)
            )
            for metrics in alignment_phase(model, expert, random, self.budget, self.counters):
                averages.add(metrics)
                if self.counters.alignment_steps % config.log_every == 0:
                    means = averages.pop()
                    if "loss/total" in means:
                        shown["loss"] = means["loss/total"]
                    self._log("alignment", "gradient_step", self.counters.alignment_steps, means)
                _, now, _ = self.budget.alignment_extent(self.counters)
                advance(min(now, total) - done, **shown)
                done = min(now, total)
                if interruption.requested:
                    return self._stop()
                self._checkpoint_if_due()
        if rest := averages.pop():
            self._log("alignment", "gradient_step", self.counters.alignment_steps, rest)
        if not self.counters.alignment_steps:
            self.console.print("nothing to align: this method's reward learns nothing before the agent acts")
        return True

    def _clone(self, interruption: Interruption) -> bool:
        demonstrations = self.components.demonstrations
        assert demonstrations is not None
        averages = Averages()
        log_every = self.run.training.interactive.log_every
        shown: dict[str, float] = {}
        total = steps_of_a_phase(demonstrations)
        done = self.counters.cloning_steps % total
        phase = cloning_phase(
            self.components.agent,
            demonstrations,
            self.components.replay,
            self.components.reward_model,
            self.rng,
            self.budget,
            self.counters,
        )
        with progress("cloning the videos", total, done, "steps") as advance:
            for metrics in phase:
                averages.add(metrics)
                before, done = done, (self.counters.cloning_steps - 1) % total + 1
                if (done % log_every == 0 or done == total) and (means := averages.pop()):
                    self._log("cloning", "gradient_step", self.counters.cloning_gradient_steps, means)
                    shown |= means
                self.counters.to_evaluate = int(done == total)
                advance(done - before, **shown)
                if interruption.requested:
                    return self._stop()
                self._checkpoint_if_due()
        watch = Stopwatch()
        self.counters.to_evaluate = 1
        self._evaluate_if_due()
        self._checkpoint()
        self.counters.cloning_seconds += watch.lap()
        return True

    def _evaluate_if_due(self) -> None:
        if self.counters.to_evaluate:
            self.evaluator.returns_on_the_way()
            self.counters.to_evaluate = 0
            if self.evaluator.newest:
                self._tell("on_evaluation", self.counters.agent_steps, self.evaluator.newest)

    def _interact(self, interruption: Interruption) -> bool:
        counters = self.counters
        if self.run.time_budget is not None and counters.agent_steps == 0:
            bought = forecast(self.run, self.components, self.budget, counters)
            self.console.print(bought.in_words(), style="bold red" if bought.little else None)
        self._evaluate_if_due()
        while self.interactive.in_progress or not self.budget.ended(counters):
            phase = self._clone if self.interactive.cloning_due else self._act_and_learn
            if not phase(interruption):
                return False
        frames = counters.agent_steps * self.task.action_repeat
        self.console.print(
            f"{counters.agent_steps:,} agent steps ({frames:,} environment frames), {counters.agent_updates:,} "
            f"updates of the agent and {counters.reward_updates:,} of the reward, after "
            f"{counters.alignment_steps:,} of alignment"
        )
        self._checkpoint()
        return True

    def _act_and_learn(self, interruption: Interruption) -> bool:
        config, counters = self.run.training, self.counters
        self.interactive.start_clock()
        unit, done, total = self.budget.interactive_extent(counters)
        with progress("acting and learning", total, done, unit) as advance:
            while self.interactive.in_progress or not (
                self.budget.ended(counters) or self.interactive.cloning_due
            ):
                began = counters.agent_steps - self.interactive.steps_in_progress
                logged = began // config.interactive.log_every
                self.interactive.play_episode()
                if self.interactive.in_progress:
                    return self._stop()
                if counters.agent_steps // config.interactive.log_every > logged:
                    self._log(
                        "interactive", "agent_steps", counters.agent_steps, self.interactive.averages.pop()
                    )
                if counters.agent_steps // config.evaluation.every > counters.evaluations:
                    counters.evaluations = counters.agent_steps // config.evaluation.every
                    counters.to_evaluate = 1
                    self._evaluate_if_due()
                _, now, _ = self.budget.interactive_extent(counters)
                advance(min(now, total) - done, **self._shown())
                done = min(now, total)
                if interruption.requested:
                    return self._stop()
                self._checkpoint_if_due()
        return True

    def _log(self, phase: str, count_name: str, count: int, metrics: Metrics) -> None:
        self.log.log(phase, count_name, count, self.counters.seconds, metrics)
        self._tell("on_log", phase, count, metrics)

    def _tell(self, event: str, *arguments: Any) -> None:
        """Calls the callbacks; who raises `StopTraining` while the run learns has it stopped after this step."""
        stop = self.callbacks(event, *arguments)
        if stop is not None and not self._ended:
            self.interruption.requested = True
            self.console.print(f"a callback stops the run: {stop}".removesuffix(": "))

    def _shown(self) -> dict[str, float]:
        """What stands beside the progress bar."""
        short = {name.removeprefix("evaluation/"): value for name, value in self.evaluator.newest.items()}
        return {"agent_steps": self.counters.agent_steps, **short}

    def _resume(self) -> Path | None:
        """Takes over the newest checkpoint, if there is one."""
        checkpoint = newest_checkpoint(self.directory / "checkpoints")
        if checkpoint is None:
            return None
        saved = load_checkpoint(checkpoint, self.components.stateful())
        self.counters = saved.counters
        self.rng = restore_generator(saved.random_state)
        self._metrics_bytes = saved.metrics_bytes
        self.console.print(
            f"resuming {self.directory} after {self.counters.alignment_steps:,} alignment steps and "
            f"{self.counters.agent_steps:,} agent steps"
        )
        return checkpoint

    def _undo_what_followed_the_checkpoint(self) -> None:
        """Not on opening a run, for benchmarks open runs that are in progress."""
        missing = cut_metrics(self.directory / "metrics.jsonl", self._metrics_bytes)
        if missing:
            self.console.print(
                f"metrics.jsonl lacks {missing:,} bytes of what was logged before the checkpoint"
            )
        drop_later_rows(self.directory, self.counters.agent_steps)

    def _checkpoint_if_due(self) -> None:
        self.demos.verification.check()
        if time.monotonic() - self._saved_at > 60 * self.run.training.checkpoint_minutes:
            self._checkpoint()

    def _checkpoint(self) -> None:
        self._metrics_bytes = self.log.bytes_written()
        written = save_checkpoint(
            self.directory / "checkpoints",
            Progress(self.counters, dict(self.rng.bit_generator.state), self._metrics_bytes),
            {
                **self.components.stateful(),
                **({"episode": self.interactive} if self.interactive.in_progress else {}),
            },
        )
        save_policy(
            self.directory, self.run, self.environment, self.components.agent, self.counters.agent_steps
        )
        self._saved_at = time.monotonic()
        self._tell("on_checkpoint", written)

    def _checkpoint_unless(self, failed: BootifolError) -> None:
        """Writes a checkpoint of what was learned before an environment failed; if that fails, too, both are told."""
        try:
            self._checkpoint()
        except BootifolError as error:
            raise BootifolError(f"{failed}; and {error}. {self.how_to_resume()}") from failed

    def _stop(self) -> bool:
        self._checkpoint()
        self.log.close()
        self.console.print(f"stopped after a checkpoint. {self.how_to_resume()}")
        return False
