"""Reads a run directory as a report needs it: typed, and tolerant of what is missing or cut.

Only `config.json` is required, since it says what the run is. Everything else may be absent or truncated (a
run in progress, a crash, a full disk); what could not be read is told in `RunFiles.notes` and in the report.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bootifol.errors import BootifolError
from bootifol.evaluation.tables import EvaluationRow, Item, RankingRow, Table, read_evaluations, read_ranking
from bootifol.files import parsed_json, read_arrays, read_json
from bootifol.old_names import with_todays_names
from bootifol.types import Arrays, Frames

ALIGNMENT = "alignment"
CLONING = "cloning"
INTERACTIVE = "interactive"
LARGEST_VIDEO = 50_000_000
"""Bytes of an mp4 file above which a report does not hold it: a run's own have less than a hundredth."""
COUNTERS = {ALIGNMENT: "gradient_step", CLONING: "gradient_step", INTERACTIVE: "agent_steps"}
"""The phases, and what each counts."""


@dataclass(frozen=True)
class Curve:
    """A metric over time; only finite values."""

    steps: NDArray[np.float64]
    """`[N]` gradient steps (alignment, cloning) or agent steps (interactive)."""

    values: NDArray[np.float64]
    """`[N]`."""

    def __len__(self) -> int:
        return len(self.steps)


@dataclass(frozen=True)
class ShowcaseVideo:
    """One episode of the showcase."""

    kind: str
    start: int
    frames: Frames
    """uint8 `[T + 1, H, W, 3]`."""

    rewards: NDArray[np.float32]
    """The learned reward `[T]`."""

    environment_return: float | None
    seed: int | None


@dataclass(frozen=True)
class RunFiles:
    """What a run directory holds."""

    path: Path
    task: str
    method: str
    preset: str
    seed: int | None
    demos: str
    time_budget: float | None
    """Seconds of wall-clock time it was given for learning; None where agent steps end it."""

    command: str
    config: Mapping[str, Any]
    versions: Mapping[str, str]
    """Of packages; also `code`, a digest of the library's own, and `processor`. Old runs lack these two."""

    videos: Mapping[str, Mapping[str, Any]]
    """`count` and `digest` of the expert's and of the random videos; empty for old runs."""

    curves: Mapping[tuple[str, str], Curve]
    """Metrics by phase and name."""

    phase_seconds: Mapping[str, tuple[float, float]]
    """Wall-clock seconds of training at the first and at the last record of each phase that tells them."""

    seconds: float | None
    """Wall-clock seconds of training, by the last record that tells them."""

    agent_steps: int
    """Agent steps of training, by the last record that counts them."""

    evaluations: Sequence[EvaluationRow]
    ranking: Sequence[RankingRow]
    showcase: Mapping[tuple[str, int], ShowcaseVideo]
    """By kind and number of the start."""

    video_files: Mapping[tuple[str, int], Path]
    """mp4 files by kind and number of the start."""

    notes: Sequence[str]
    """What is missing or damaged, one sentence each."""

    @property
    def label(self) -> str:
        """Short name of the run among others of its task."""
        return self.method if self.seed is None else f"{self.method}, seed {self.seed}"

    def curve(self, phase: str, name: str) -> Curve | None:
        """A metric, or None where nothing was recorded."""
        return self.curves.get((phase, name))

    def starts(self) -> list[int]:
        """Numbers of the starts of the showcase."""
        return sorted({start for _, start in self.showcase})

    def episode_lengths(self, scaled: bool = False) -> list[int]:
        """Lengths of the evaluation episodes, shortest first; on request only of those that have a scale."""
        rows = self.evaluations
        return sorted({row.episode_steps for row in rows if not scaled or row.scaled_return is not None})

    def evaluations_of(self, episode_steps: int) -> dict[int, list[EvaluationRow]]:
        """Evaluations with episodes of one length, by agent steps of training in rising order."""
        grouped: dict[int, list[EvaluationRow]] = {}
        for row in sorted(self.evaluations, key=lambda row: row.agent_steps):
            if row.episode_steps == episode_steps and np.isfinite(row.environment_return):
                grouped.setdefault(row.agent_steps, []).append(row)
        return grouped

    def return_levels(self, episode_steps: int) -> tuple[float, float] | None:
        """Returns of the random agent and of the expert, recovered from the scale of the evaluations.

        None where no two evaluations of this length have different scaled returns.
        """
        rows = [
            r for rs in self.evaluations_of(episode_steps).values() for r in rs if r.scaled_return is not None
        ]
        if not rows:
            return None
        low, high = min(rows, key=_scaled), max(rows, key=_scaled)
        if _scaled(high) - _scaled(low) < 1e-6:
            return None
        slope = (high.environment_return - low.environment_return) / (_scaled(high) - _scaled(low))
        random = low.environment_return - slope * _scaled(low)
        return random, random + slope

    def sight_moments(self) -> dict[int, dict[str, float]]:
        """What `evaluation/sight.py` said, by agent steps in rising order; 0 is right after alignment."""
        moments: dict[int, dict[str, float]] = {}
        for (phase, name), curve in self.curves.items():
            if phase == INTERACTIVE and name.startswith("sight/"):
                for steps, value in zip(curve.steps, curve.values, strict=True):
                    moments.setdefault(int(steps), {})[name.removeprefix("sight/")] = float(value)
        return dict(sorted(moments.items()))

    def ranking_moments(self) -> dict[int, list[RankingRow]]:
        """Ranked videos by agent steps in rising order; 0 is right after alignment."""
        grouped: dict[int, list[RankingRow]] = {}
        for row in sorted(self.ranking, key=lambda row: row.agent_steps):
            if np.isfinite(row.reward):
                grouped.setdefault(row.agent_steps, []).append(row)
        return grouped


def is_run(path: Path) -> bool:
    """Whether a directory is a run's."""
    return (path / "config.json").is_file()


def find_runs(paths: Sequence[Path], wanted: Callable[[Path], bool] = is_run) -> list[Path]:
    """The run directories among the paths and below them, each once, in the order given.

    What lies inside a run is passed over, so that a shell may expand `runs/**`.

    Args:
        paths: where to look.
        wanted: what counts as a run.

    Raises:
        BootifolError: there are no paths, or one leads to no run.
    """
    if not paths:
        raise BootifolError("there is no run; name the directory of one at least, or one that holds several")
    found: dict[Path, Path] = {}
    for path in paths:
        if not path.exists() and not wanted(path):
            raise BootifolError(
                f"there is no directory {path}; give directories that `train` wrote, or one that holds them"
            )
        below = _runs_below(path, wanted, set())
        if not below and not any(wanted(parent) for parent in path.resolve().parents):
            raise BootifolError(
                f"there is no run in {path}; give directories that `train` wrote, or one that holds them"
            )
        for run_dir in below:
            found.setdefault(run_dir.resolve(), run_dir)
    if not found:
        raise BootifolError(
            f"there is no run in {paths[0]}, which lies inside one; give the run's own directory"
        )
    return list(found.values())


def _runs_below(path: Path, wanted: Callable[[Path], bool], seen: set[Path]) -> list[Path]:
    """Each directory is looked into once, for links may form circles."""
    if wanted(path):
        return [path]
    if not path.is_dir() or path.resolve() in seen:
        return []
    seen.add(path.resolve())
    return [run_dir for child in sorted(path.iterdir()) for run_dir in _runs_below(child, wanted, seen)]


def read_run(run_dir: Path) -> RunFiles:
    """Reads a run directory.

    Raises:
        BootifolError: the directory or its `config.json` is missing, or does not describe a run.
    """
    if not run_dir.is_dir():
        raise BootifolError(f"there is no run directory {run_dir}; give the directory that `train` wrote")
    config_path = run_dir / "config.json"
    header = read_json(config_path, f"the configuration of the run {run_dir}", editable=True)
    notes: list[str] = []
    curves, phase_seconds = _read_metrics(run_dir / "metrics.jsonl", notes)
    return described(
        run_dir,
        header,
        config_path,
        notes,
        curves=curves,
        phase_seconds=phase_seconds,
        evaluations=read_table(run_dir / "evaluations.csv", read_evaluations, "evaluations", notes),
        ranking=read_table(run_dir / "ranking.csv", read_ranking, "ranking of held-out videos", notes),
        showcase=_read_showcase(run_dir / "showcase.safetensors", notes),
        video_files=_find_videos(run_dir / "videos", notes),
    )


def described(
    path: Path,
    header: object,
    header_path: Path,
    notes: list[str],
    *,
    curves: Mapping[tuple[str, str], Curve],
    phase_seconds: Mapping[str, tuple[float, float]],
    evaluations: Sequence[EvaluationRow],
    ranking: Sequence[RankingRow],
    showcase: Mapping[tuple[str, int], ShowcaseVideo] = MappingProxyType({}),
    video_files: Mapping[tuple[str, int], Path] = MappingProxyType({}),
    agent_steps: int = 0,
) -> RunFiles:
    """A run by what its `config.json` says and what it measured.

    Args:
        path: the run's.
        header: the content of its `config.json`.
        header_path: the file that the header was read from.
        notes: what is missing or damaged so far; what the header lacks is added.
        curves: metrics by phase and name.
        phase_seconds: the first and the last seconds of each phase.
        evaluations: its evaluation episodes.
        ranking: its ranked videos.
        showcase: its episodes by kind and start.
        video_files: its mp4 files by kind and start.
        agent_steps: how far it is known to have learned, where curves and evaluations do not tell all.

    Raises:
        BootifolError: the header does not describe a run.
    """
    if not isinstance(header, dict) or not isinstance(header.get("task"), str):
        raise BootifolError(
            f"{header_path} does not describe a run: it names no task; give the directory that `train` wrote"
        )
    seconds = [
        *(last for _, last in phase_seconds.values()),
        *(row.seconds for row in evaluations if _is_finite(row.seconds)),
    ]
    counted = [int(c.steps[-1]) for (phase, _), c in curves.items() if phase == INTERACTIVE and len(c)]
    seed, time_budget = header.get("seed"), header.get("time_budget")
    return RunFiles(
        path=path,
        task=header["task"],
        method=str(header.get("method", "unknown method")),
        preset=str(header.get("preset", "unknown preset")),
        seed=seed if isinstance(seed, int) and not isinstance(seed, bool) else None,
        demos=_as_text(header.get("demos", "")),
        time_budget=float(time_budget)
        if _is_finite(time_budget) and isinstance(time_budget, int | float)
        else None,
        command=_as_text(header.get("command", "")),
        config=with_todays_names(_as_mapping(header.get("config"), "config", notes)),
        versions=_versions(header, notes),
        videos={
            k: v
            for k, v in _as_mapping(header.get("videos", {}), "videos", notes).items()
            if isinstance(v, dict)
        },
        curves=curves,
        phase_seconds=phase_seconds,
        seconds=max(seconds) if seconds else None,
        agent_steps=max([agent_steps, *counted, *(row.agent_steps for row in evaluations)]),
        evaluations=evaluations,
        ranking=ranking,
        showcase=showcase,
        video_files=video_files,
        notes=notes,
    )


def flattened(config: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """The fields of a nested configuration as rows of dotted name and value."""
    for name, value in config.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", str(value)


def _scaled(row: EvaluationRow) -> float:
    return 0.0 if row.scaled_return is None else row.scaled_return


def _as_text(value: object) -> str:
    """A command or a path, written as text or as a list of arguments."""
    if isinstance(value, list):
        return shlex.join(str(part) for part in value)
    return "" if value is None else str(value)


def _as_mapping(value: object, what: str, notes: list[str]) -> dict[str, Any]:
    if isinstance(value, dict):
        return value
    notes.append(f"config.json has no table of {what}.")
    return {}


def _versions(header: Mapping[str, Any], notes: list[str]) -> dict[str, str]:
    """What the run was begun with; where it was resumed with something else, `the one, then the other`."""
    found = {
        name: str(value) for name, value in _as_mapping(header.get("versions"), "versions", notes).items()
    }
    resumed = header.get("resumed", [])
    for stage in resumed if isinstance(resumed, list) else []:
        later = _as_mapping(stage.get("versions", {}), "versions", notes) if isinstance(stage, dict) else {}
        for name, value in later.items():
            before = found.get(name, "unknown")
            if before.split(", then ")[-1] != str(value):
                found[name] = f"{before}, then {value}"
    return found


def _read_metrics(
    path: Path, notes: list[str]
) -> tuple[dict[tuple[str, str], Curve], dict[str, tuple[float, float]]]:
    """Curves by phase and name, and the first and last seconds of each phase."""
    try:
        if not path.is_file():
            raise FileNotFoundError
        lines = path.read_text(errors="replace").splitlines()
    except OSError:
        notes.append("metrics.jsonl is missing: no losses and no learned reward over time.")
        return {}, {}
    points: dict[tuple[str, str], tuple[list[float], list[float]]] = {}
    seconds: dict[str, tuple[float, float]] = {}
    damaged = dropped = 0
    for line in lines:
        record = _parse_record(line)
        if record is None:
            damaged += bool(line.strip())
            continue
        phase = str(record["phase"])
        counter = COUNTERS[phase]
        for name, value in record.items():
            if name == "seconds" and _is_finite(value):
                first, last = seconds.get(phase, (float(value), float(value)))
                seconds[phase] = min(first, float(value)), max(last, float(value))
            elif name not in ("phase", counter, "seconds") and isinstance(value, int | float | None):
                if value is not None and _is_finite(value):
                    steps, values = points.setdefault((phase, name), ([], []))
                    steps.append(float(record[counter]))
                    values.append(float(value))
                else:
                    dropped += 1
    if damaged:
        notes.append(
            f"metrics.jsonl: {_count(damaged, 'line')} could not be read, as after an interrupted write."
        )
    if dropped:
        notes.append(
            f"metrics.jsonl: {_count(dropped, 'value')} that are not finite were left out of the plots."
        )
    curves = {}
    for key, (steps, values) in points.items():
        order = np.argsort(steps, kind="stable")
        curves[key] = Curve(np.array(steps)[order], np.array(values)[order])
    return curves, seconds


def _parse_record(line: str) -> dict[str, Any] | None:
    """One line of metrics.jsonl; None where it is not a record with a phase and its counter."""
    try:
        record = parsed_json(line, constants=True)
    except ValueError:
        return None
    if not isinstance(record, dict) or not isinstance(record.get("phase"), str):
        return None
    if record["phase"] not in COUNTERS:
        return None
    return record if _is_finite(record.get(COUNTERS[record["phase"]])) else None


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def read_table(path: Path, read: Callable[[Path], Table[Item]], what: str, notes: list[str]) -> list[Item]:
    """The rows of a table; what is missing or damaged becomes a note.

    Args:
        path: of the table.
        read: how it is read.
        what: what it holds, for the note.
        notes: where the note is put.
    """
    if not path.exists():
        notes.append(f"{path.name} is missing: no {what}.")
        return []
    try:
        table = read(path)
    except BootifolError as error:
        notes.append(f"{path.name} was left out: {error}.")
        return []
    if table.damaged_lines:
        numbers = ", ".join(str(line) for line in table.damaged_lines[:5])
        notes.append(
            f"{path.name}: {_count(len(table.damaged_lines), 'line')} could not be read (line {numbers})."
        )
    return table.rows


def _read_showcase(path: Path, notes: list[str]) -> dict[tuple[str, int], ShowcaseVideo]:
    if path.exists() and _leaves(path.parent, path):
        notes.append("showcase.safetensors was left out: it is a link that leaves the run.")
        return {}
    if not path.exists():
        notes.append("showcase.safetensors is missing: no film strips and no reward along videos.")
        return {}
    try:
        arrays = read_arrays(path, "the showcase")
    except BootifolError as error:
        notes.append(f"showcase.safetensors was left out: {error}.")
        return {}
    showcase: dict[tuple[str, int], ShowcaseVideo] = {}
    for name in sorted(arrays):
        match = re.fullmatch(r"frames/([^/]+)/(\d{1,9})", name)
        if match is None:
            continue
        kind, start = match.group(1), int(match.group(2))
        video = _showcase_video(arrays, kind, start)
        if video is None:
            notes.append(
                f"showcase.safetensors: {kind} {start} was left out: its frames or rewards do not fit."
            )
        else:
            showcase[kind, start] = video
    return showcase


def _showcase_video(arrays: Arrays, kind: str, start: int) -> ShowcaseVideo | None:
    frames, rewards = arrays[f"frames/{kind}/{start}"], arrays.get(f"reward/{kind}/{start}")
    if frames.ndim != 4 or frames.shape[-1] != 3 or frames.dtype != np.uint8 or len(frames) < 2:
        return None
    if rewards is None or rewards.shape != (len(frames) - 1,) or rewards.dtype.kind not in "iuf":
        return None
    returns = arrays.get(f"environment_return/{kind}/{start}")
    seeds = arrays.get(f"seed/{kind}/{start}")
    return ShowcaseVideo(
        kind=kind,
        start=start,
        frames=frames.astype(np.uint8, copy=False),
        rewards=rewards.astype(np.float32),
        environment_return=_one_number(returns),
        seed=None if (number := _one_number(seeds)) is None else int(number),
    )


def _one_number(array: NDArray[np.generic] | None) -> float | None:
    if array is None or array.size != 1 or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        return None
    return array.ravel()[0].item()  # type: ignore[no-any-return]


def _find_videos(directory: Path, notes: list[str]) -> dict[tuple[str, int], Path]:
    found: dict[tuple[str, int], Path] = {}
    for path in sorted(directory.glob("*.mp4")):
        match = re.fullmatch(r"(\w+)-(\d{1,9})\.mp4", path.name)
        if match is None:
            continue
        if _leaves(directory.parent, path):
            notes.append(f"videos/{path.name} was left out: it is a link that leaves the run.")
        elif not path.is_file() or path.stat().st_size > LARGEST_VIDEO:
            notes.append(f"videos/{path.name} was left out: it is no video of a run's.")
        elif path.stat().st_size == 0:
            notes.append(f"videos/{path.name} is empty.")
        else:
            found[match.group(1), int(match.group(2))] = path
    if not found:
        notes.append("there are no videos to play.")
    return found


def _leaves(run_dir: Path, path: Path) -> bool:
    """Whether a path is a link that leads out of the run, or nowhere: a stranger would choose which of this machine's
    files a report shows."""
    try:
        return not path.resolve(strict=True).is_relative_to(run_dir.resolve())
    except (OSError, RuntimeError):  # the latter where links form a circle
        return True


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
