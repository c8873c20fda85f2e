"""Demo sets whose imported videos are brought toward an environment's pictures; the manifest says what was done."""

from __future__ import annotations

import shutil
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from bootifol.demos.contact_sheet import write_contact_sheet
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.fit import shown_like
from bootifol.demos.manifest import Manifest, Shard, VideoEntry, find_demo_sets, write_manifest
from bootifol.demos.matching import REPAIRS, Match, Picture, Repair, difference, fit
from bootifol.demos.scene_match import (
    FIRST_FRAMES_NAME,
    differences_of_looks,
    first_frames,
    write_first_frames,
)
from bootifol.demos.shards import sha256_of_frames, write_shard
from bootifol.envs.pictures import PictureConfig
from bootifol.errors import BootifolError
from bootifol.files import written_aside
from bootifol.progress import progress
from bootifol.tasks import Task, make_environment
from bootifol.types import Frames

MATCHED = "matched"
"""Where a manifest's conversion says what was done."""

USUAL_NAME, BACKGROUND_NAME, ENVIRONMENT_NAME = (
    "matched_usual.png",
    "matched_background.png",
    "matched_environment.png",
)
"""The pictures that a match needs, beside the shards."""

LOOKED_AT = 24
"""Videos from which is fitted what to do."""

EPISODES, STEPS = 8, 12
"""Episodes of random actions, and their steps, from which the environment's background is taken."""


@dataclass(frozen=True)
class MatchedSet:
    """What became of one demo set."""

    path: Path
    match: Match | None
    """None for a set that was recorded in the environment: it was copied."""
    before: float = 0.0
    """How far the videos' median first picture is from the environment's, in levels of 255."""
    after: float = 0.0
    remaining: tuple[str, ...] = ()
    """What `demos check` still says of their looks."""


def match_demo_sets(
    demos: Path, task: Task, out: Path, repairs: Collection[Repair] = REPAIRS
) -> dict[str, MatchedSet]:
    """Writes the sets of a directory again, imported videos brought toward the task's pictures.

    The same is done to all of them, as it was fitted on the expert's (or on the first set, if there is no expert).

    Args:
        demos: directory of the demo sets, or one of them.
        task: whose environment shows how they should look.
        out: directory to write; it must not exist. It appears whole or not at all.
        repairs: which may be made.

    Raises:
        BootifolError: `out` exists, no set was imported, one was matched already, or a set is damaged.
    """
    if out.exists():
        raise BootifolError(f"{out} exists already: choose another directory or remove it")
    sets = {behavior: DemoSet.open(path) for behavior, path in find_demo_sets(demos).items()}
    imported = {behavior: found for behavior, found in sets.items() if found.manifest.task is None}
    if not imported:
        raise BootifolError(
            f"the videos of {demos} were recorded in an environment: only imported ones are matched"
        )
    for found in imported.values():
        if MATCHED in (found.manifest.conversion or {}):
            raise BootifolError(f"{found.path} was matched already: match the set that it was made from")
    fitted_on = imported.get("expert", next(iter(imported.values())))
    pictures = PictureConfig()
    pictures = replace(pictures, **shown_like(fitted_on.manifest, pictures))
    environment = first_frames(task, pictures)
    match = fit(
        _first_frames(fitted_on),
        (_seen(fitted_on, int(index)) for index in _spread(len(fitted_on), LOOKED_AT)),
        environment,
        _acting(task, pictures),
        repairs,
    )
    matched: dict[str, MatchedSet] = {}
    with written_aside(out) as aside:
        aside.mkdir(parents=True)
        for behavior, found in sets.items():
            if behavior in imported:
                matched[behavior] = _written(
                    found, match, task, aside / behavior, out / behavior, environment
                )
            else:
                shutil.copytree(found.path, aside / behavior)
                matched[behavior] = MatchedSet(out / behavior, None)
    return matched


def match_of(path: Path, manifest: Manifest) -> Match:
    """What was done to the videos of a set; the identity where nothing was.

    Raises:
        BootifolError: its pictures are missing or damaged.
    """
    done = (manifest.conversion or {}).get(MATCHED)
    if done is None:
        return Match(manifest.video_size)
    usual = _read(path / USUAL_NAME) if done["exposure"] else None
    background = (
        (_read(path / BACKGROUND_NAME), _read(path / ENVIRONMENT_NAME)) if done["background"] else None
    )
    crop = None if done["crop"] is None else tuple(done["crop"])
    return Match(manifest.video_size, crop, tuple(done["gain"]), tuple(done["offset"]), usual, background)


def _written(
    found: DemoSet, match: Match, task: Task, aside: Path, target: Path, environment: Frames
) -> MatchedSet:
    aside.mkdir()
    manifest = found.manifest
    shards: list[Shard] = []
    entries: list[VideoEntry] = []
    with progress(f"matching {manifest.name}", total=len(found)) as advance:
        for shard in manifest.shards:
            videos = []
            for _ in range(shard.videos):
                video, entry = match(found[len(entries)].frames), manifest.videos[len(entries)]
                entries.append(replace(entry, sha256=sha256_of_frames(video)))
                videos.append(video)
                advance()
            shards.append(write_shard(aside, len(shards), np.stack(videos)))
    _save(aside, match)
    done: dict[str, Any] = match.described() | {"task": task.name}
    conversion = (manifest.conversion or {}) | {MATCHED: done}
    write_manifest(
        aside, replace(manifest, conversion=conversion, shards=tuple(shards), videos=tuple(entries))
    )
    written = DemoSet.open(aside)
    write_contact_sheet(aside, written)
    after = _first_frames(written)
    write_first_frames(aside, after, environment)
    return MatchedSet(
        target,
        match,
        difference(_first_frames(found), environment),
        difference(after, environment),
        tuple(differences_of_looks(after, environment, target / FIRST_FRAMES_NAME)),
    )


def _first_frames(demo_set: DemoSet) -> Frames:
    return np.stack([demo_set[index].frames[0] for index in range(len(demo_set))])


def _seen(demo_set: DemoSet, index: int) -> Frames:
    """A video without the pictures that only fill it up."""
    return demo_set[index].frames[: demo_set.manifest.videos[index].length]


def _spread(total: int, most: int) -> list[int]:
    return [int(index) for index in np.unique(np.linspace(0, total - 1, most).round())]


def _acting(task: Task, pictures: PictureConfig) -> Frames:
    """Pictures of the environment under random actions, uint8 `[n, H, W, 3]`."""
    environment = make_environment(task.name, pictures, task.episode_steps, task.action_repeat)
    rng = np.random.default_rng(0)
    frames = []
    try:
        for seed in range(EPISODES):
            _, info = environment.reset(seed=seed)
            frames.append(info["video_frame"])
            for _ in range(STEPS):
                action = rng.uniform(-1.0, 1.0, environment.action_space.shape).astype(np.float32)
                _, _, ended, cut, info = environment.step(action)
                frames.append(info["video_frame"])
                if ended or cut:
                    break
    finally:
        environment.close()
    return np.stack(frames)


def _save(directory: Path, match: Match) -> None:
    pictures: dict[str, Picture] = {}
    if match.usual is not None:
        pictures[USUAL_NAME] = match.usual
    if match.background is not None:
        pictures[BACKGROUND_NAME], pictures[ENVIRONMENT_NAME] = match.background
    for name, picture in pictures.items():
        Image.fromarray(picture.round().clip(0, 255).astype(np.uint8)).save(directory / name)


def _read(path: Path) -> Picture:
    try:
        with Image.open(path) as picture:
            return np.asarray(picture.convert("RGB"), np.float32)
    except (OSError, SyntaxError, ValueError) as error:
        raise BootifolError(
            f"{path} is missing or damaged, and videos are matched by it: restore it ({error})"
        ) from error
