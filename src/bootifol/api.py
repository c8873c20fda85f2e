"""What the command line does, as functions: train, go on, evaluate, score."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from bootifol.demos.demo_set import DemoSet
from bootifol.demos.import_videos import LARGEST_SQUARE, read_recordings
from bootifol.demos.manifest import MANIFEST_NAME, find_demo_sets, read_manifest
from bootifol.demos.match_set import match_of
from bootifol.envs.rollout import PlayedEpisode
from bootifol.errors import (
    LARGEST_COUNT,
    LARGEST_SEED,
    BootifolError,
    require_at_least,
    require_at_most,
)
from bootifol.evaluation.returns import EpisodeResult, evaluation_rows, evaluation_seeds, scaled_return
from bootifol.evaluation.returns import evaluate as evaluate_act
from bootifol.evaluation.summary import Summary, summarize
from bootifol.evaluation.tables import EvaluationRow
from bootifol.files import written_aside
from bootifol.output import output_may_fail
from bootifol.presets import preset as preset_named
from bootifol.progress import progress
from bootifol.rewards.references import draw_references, reference_rng
from bootifol.rewards.registry import check_method
from bootifol.training.build import build_backbone, build_environment, build_reward_model
from bootifol.training.callbacks import Callback
from bootifol.training.checkpoint import load_checkpoint
from bootifol.training.config import TrainingConfig
from bootifol.training.open_demos import open_demos
from bootifol.training.overrides import overridden
from bootifol.training.run_config import RunConfig, require_time_to_act
from bootifol.training.run_directory import (
    require_resumable,
    require_same_videos,
    require_unused,
    writing_run,
)
from bootifol.training.saved_policy import require_checkpoint, restored_agent
from bootifol.training.trainer import Trainer
from bootifol.types import AnyPath, Rewards, Video
from bootifol.video_files.writing import write_video


@dataclass(frozen=True)
class TrainedRun:
    """What `train` leaves. It stands for its directory wherever a path does."""

    directory: Path
    finished: bool
    """False if it was asked to stop before its end: `resume` goes on."""

    def __fspath__(self) -> str:
        return str(self.directory)


def train(
    task: str,
    demos: AnyPath,
    out: AnyPath,
    *,
    method: str = "bootifol",
    preset: str = "cpu",
    seed: int = 1,
    time_budget: float | None = None,
    config: TrainingConfig | None = None,
    overrides: Mapping[str, Any] | None = None,
    callbacks: Sequence[Callback] = (),
    command: Sequence[str] = (),
) -> TrainedRun:
    """Learns a reward from videos and trains a policy on it; writes the run's directory and its report.

    Ctrl-C and SIGTERM make it write a checkpoint and return early, which the result says.

    Args:
        task: from the catalogue, or `gymnasium:ID`, or `module:function`, or what an installed package brings.
        demos: directory of the videos.
        out: directory of the run, new or empty.
        method: bootifol, virl, context_translation, gaifo, environment for the upper bound, or `module:name` for
            one of your own, or what an installed package brings.
        preset: paper, cpu, long, frames, backbone, drawn, drawn_pixels, demo or smoke.
        seed: of everything random.
        time_budget: seconds of wall-clock time for learning; None for the configuration's agent steps.
        config: instead of the preset's; `bootifol.preset(NAME)` returns one.
        overrides: single fields of it, such as `{"agent.batch_size": 64}`; `bootifol train --help-all` lists them.
        callbacks: told what happens while it learns, and able to stop it: `bootifol.Callback` says when.
        command: what the user typed, for the report.

    Returns:
        The run's directory, and whether it came to its end.

    Raises:
        BootifolError: bad input, or an error that the run can be resumed from, which its sentence says; and whatever a
            callback raises.
    """
    directory = Path(out)
    run = RunConfig(
        task=task,
        method=method,
        preset=preset,
        seed=seed,
        demos=str(demos),
        time_budget=time_budget,
        training=overridden(config or preset_named(preset, method), overrides or {}),
    )
    if time_budget is not None:
        require_time_to_act(run.training)
    with output_may_fail(), writing_run(directory):
        require_unused(directory)
        trainer = Trainer(run, directory, _console(), callbacks)
        trainer.begin_tracker()
        run.write(directory, list(command))
        return TrainedRun(directory, finished=trainer.run())


def resume(directory: AnyPath, trust: bool = False, callbacks: Sequence[Callback] = ()) -> bool:
    """Goes on with a run from its newest checkpoint, to its end, its final evaluation and its report.

    Args:
        directory: of the run.
        trust: whether code that its `config.json` names (a task or a method `MODULE:NAME`) may be imported.
        callbacks: as of `train`.

    Returns:
        False if it was asked to stop before its end.

    Raises:
        BootifolError: there is no run or no checkpoint, the videos are others than it began with, another process
            writes to the run, or an error that the run can be resumed from.
    """
    directory = Path(directory)
    run = _run_with_demos(directory, trust)
    with output_may_fail(), writing_run(directory):
        require_resumable(directory)
        return Trainer(run, directory, _console(), callbacks).run()


@dataclass(frozen=True)
class RunEvaluation:
    """Returns of a run's newest policy."""

    episodes: list[EpisodeResult]
    summary: Summary
    """Of the environment's returns."""
    scaled_return: float | None
    """0 for random actions, 1 for the expert; None where the task has no measured returns."""
    episode_steps: int
    rows: list[EvaluationRow]
    """The episodes as rows of a table."""

    @property
    def solved(self) -> int | None:
        """In how many episodes the task was solved at any step; None where the environment does not say."""
        told = [result.success for result in self.episodes if result.success is not None]
        return sum(told) if told else None


def evaluate(
    directory: AnyPath,
    episodes: int = 10,
    seed: int = 1000,
    videos: AnyPath | None = None,
    trust: bool = False,
) -> RunEvaluation:
    """Plays a run's newest policy, without exploration, in episodes of the task's evaluation length.

    Args:
        directory: of the run.
        episodes: how many, at least one.
        seed: of the starts.
        videos: directory to write each episode to as `episode-<number from 0>.mp4`; None writes none.
        trust: whether code that its `config.json` names (a task or a method `MODULE:NAME`) may be imported.

    Raises:
        BootifolError: there is no run, it has no checkpoint yet, or a file cannot be read or written.
    """
    require_at_least(0, seed=seed)
    require_at_most(LARGEST_SEED, seed=seed)
    require_at_most(LARGEST_COUNT, episodes=episodes)
    run = RunConfig.read(Path(directory), trust, needs_method=False)
    task = run.resolved_task()
    environment = build_environment(run, task.evaluation_steps)
    agent, saved = restored_agent(run, Path(directory), environment)
    with progress(f"playing {Path(directory)}", episodes) as advance:

        def film(episode: int, played: PlayedEpisode) -> None:
            if videos is not None:
                target = Path(videos) / f"episode-{episode}.mp4"
                write_video(target, played.episode.largest_frames, environment.metadata["render_fps"])
            advance(1)

        results = evaluate_act(
            environment,
            lambda observation: agent.act(observation, run.training.interactive.agent_steps, explore=False),
            evaluation_seeds(seed, episodes),
            watch=film,
        )
    environment.close()
    summary = summarize([result.environment_return for result in results])
    levels = {"expert_return": task.expert_return, "random_return": task.random_return}
    rows = evaluation_rows(
        results,
        agent_steps=saved.counters.agent_steps,
        seconds=saved.counters.seconds,
        episode_steps=task.evaluation_steps,
        **levels,
    )
    return RunEvaluation(results, summary, scaled_return(summary.mean, **levels), task.evaluation_steps, rows)


def score(directory: AnyPath, videos: Sequence[AnyPath], trust: bool = False) -> dict[str, Rewards]:
    """The learned reward along videos, each compared with the same expert videos where the method compares.

    Args:
        directory: of the run.
        videos: video files, folders of frames, .npy files, LeRobot datasets or demo sets. Files are cut to a square and
            resampled to the expert videos' pictures per second, as an import does.
        trust: whether code that its `config.json` names (a task or a method `MODULE:NAME`) may be imported.

    Returns:
        Rewards `[T]` by the video's name. A video longer than those it is compared with is scored as far as they reach.
    """
    return {video.name: rewards for video, rewards in scored_videos(directory, videos, trust)}


def scored_videos(
    directory: AnyPath, videos: Sequence[AnyPath], trust: bool = False
) -> Iterator[tuple[Video, Rewards]]:
    """The same one by one, with the pictures that were scored.

    Raises:
        BootifolError: there are no videos, one cannot be read, or the run has no reward for them.
    """
    if not videos:
        raise BootifolError("there are no videos to score: name files, folders of pictures, or demo sets")
    run = _run_with_demos(directory, trust)
    model = build_reward_model(run)
    if model.reads_environment_reward:
        raise BootifolError(
            f"{directory} was trained on the environment's reward: it has no reward for videos"
        )
    load_checkpoint(require_checkpoint(Path(directory)), {"reward_model": model})
    expert = open_demos(run, run.resolved_task(), build_backbone(run), _console()).expert
    references = draw_references(model, expert, reference_rng(run.seed, 0))
    length = min((len(reference.frames) for reference in references), default=None)
    for path in map(Path, videos):
        for video in read_videos(path, run):
            shortened = Video(video.name, video.frames[:length])
            yield shortened, model.label(shortened, references)


def write_scores(path: Path, scores: dict[str, Rewards]) -> None:
    """Writes `score`' result as CSV with the columns video, step, reward."""
    with written_aside(path) as aside, aside.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["video", "step", "reward"])
        for name, rewards in scores.items():
            writer.writerows([name, step, f"{reward:.6g}"] for step, reward in enumerate(rewards))


def _run_with_demos(directory: AnyPath, trust: bool) -> RunConfig:
    """A run's configuration, once its method and its videos are seen to be where it looks for them."""
    run = RunConfig.read(Path(directory), trust)
    check_method(run.method)
    if not Path(run.demos).is_dir():
        raise BootifolError(
            f"the videos that {directory} learns from are not at {run.demos}: give the command in the directory in "
            "which the run was started, or put them back"
        )
    require_same_videos(Path(directory), run)
    return run


def _console() -> Console:
    """Where messages go; what they hold, such as a path, is no markup."""
    return Console(stderr=True, markup=False, emoji=False, soft_wrap=True)


def read_videos(path: Path, run: RunConfig) -> Iterator[Video]:
    """The videos there, with size, crop, pace and looks of those that the run learned from."""
    if (path / MANIFEST_NAME).is_file():
        demo_set = DemoSet.open(path)
        yield from map(demo_set.__getitem__, range(len(demo_set)))
        return
    directory = find_demo_sets(run.demos)["expert"]
    expert = read_manifest(directory)
    matched = match_of(directory, expert)
    size, camera = run.training.pictures.video_size, expert.videos[0].source.get("camera")
    crop = (expert.conversion or {}).get("crop", LARGEST_SQUARE)
    chosen = None if crop == LARGEST_SQUARE else tuple(crop)
    for name, frames in read_recordings(path, size, expert.frames_per_second, camera, chosen):
        yield Video(name, matched(frames))
