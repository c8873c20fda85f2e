"""The videos of a run: found, checked, some of them set aside, and varied in looks where the configuration says so."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from rich.console import Console

from bootifol.demos.augmentation import augmented
from bootifol.demos.demo_set import DemoSet
from bootifol.demos.features import FeaturizedVideos, without_pixels
from bootifol.demos.fit import differences, look_alike
from bootifol.demos.manifest import find_demo_sets, read_manifest
from bootifol.demos.record import record
from bootifol.demos.verification import Verification
from bootifol.errors import BootifolError
from bootifol.evaluation.ranking import KINDS
from bootifol.networks.backbones import Backbone
from bootifol.tasks import Task
from bootifol.training.run_config import RunConfig
from bootifol.types import OtherCamera, Video, VideoSource

_VERIFY_BELOW_BYTES = 1_000_000_000


@dataclass(frozen=True)
class Demos:
    """The videos of a run."""

    expert: VideoSource
    """D_e: the expert videos that the reward learns from and agents are compared with."""
    random: VideoSource
    """Videos of a random policy, the other class of the Alignment Phase."""
    held_out: dict[str, list[Video]] = field(default_factory=dict)
    """Videos by kind that the reward never learns from, to see whether it ranks them right."""
    augmented: bool = False
    """Whether samples of `expert` and `random` vary in looks; the agent's videos then do, too."""
    imported: bool = False
    """Whether the expert videos come from files."""
    verification: Verification = field(default_factory=Verification)
    """Of the sets that were too large to be verified on opening."""


def open_demos(run: RunConfig, task: Task, backbone: Backbone | None, console: Console) -> Demos:
    """Opens the demo sets of a run; records the random videos where there are none.

    Args:
        run: what it is.
        task: the run's, resolved.
        backbone: computes the features of the videos; None where the reward model reads pixels.
        console: where sentences go.

    Raises:
        BootifolError: there are no expert videos, or they do not match the task and the configuration.
    """
    root, training = Path(run.demos), run.training
    paths = find_demo_sets(root)
    if "expert" not in paths:
        recording = f"record them with `bootifol demos record --task {run.task} --out {root}` or "
        raise BootifolError(
            f"there are no expert videos in {root}: {recording if task.has_expert else ''}"
            f"import your own with `bootifol demos import YOUR_VIDEOS --out {root}`"
        )
    unverified: list[DemoSet] = []
    expert = _open(paths["expert"], run, task, unverified)
    if "random" not in paths:
        console.print("no random videos beside the expert's; recording as many")
    if "random" not in paths or not read_manifest(paths["random"]).complete:
        paths["random"] = root / "random"
        record(
            run.task,
            "random",
            len(expert),
            paths["random"],
            training.pictures,
            # The same seed draws the same starts, so no start tells expert from random.
            seed=run.seed if expert.manifest.seed is None else expert.manifest.seed,
            episode_steps=expert.manifest.frames - 1,
            action_repeat=training.action_repeat,
        )
    held_out = min(training.evaluation.held_out_videos, len(expert) // 5)
    sources: dict[str, VideoSource] = {}
    kept: dict[str, list[Video]] = {}
    for kind in KINDS:
        if kind not in paths:
            continue
        demo_set = expert if kind == "expert" else _open(paths[kind], run, task, unverified)
        learned_from, aside = demo_set.split(min(held_out, len(demo_set) - 1))
        if backbone is None:
            sources[kind] = learned_from
            kept[kind] = [aside[index] for index in range(len(aside))]
            continue
        sources[kind] = featurized = FeaturizedVideos(learned_from, backbone)
        if kind in ("expert", "random"):
            featurized.compute()
        featurized_aside = FeaturizedVideos(aside, backbone)
        kept[kind] = without_pixels(featurized_aside[index] for index in range(len(aside)))
    imported = expert.manifest.conversion is not None
    if not (compares_in_time(run) or look_alike(expert.manifest, read_manifest(paths["random"]))):
        sources["random"] = OtherCamera(sources["random"])
        console.print(
            "the eyes learn from the expert's videos alone: others look otherwise, whatever they show"
        )
    other_camera = isinstance(sources["random"], OtherCamera)
    varied = backbone is None and training.augmentation.applies(imported) and not other_camera
    if varied:
        console.print("the reward learns from videos of varying looks (augmentation)")
    return Demos(
        augmented(sources["expert"], varied),
        augmented(sources["random"], varied),
        kept if held_out else {},
        varied,
        imported,
        Verification(unverified),
    )


def compares_in_time(run: RunConfig) -> bool:
    """Whether the reward compares an episode with whole videos, which must be as long then; single frames need not."""
    return run.method not in ("bootifol", "environment") or run.training.reward.bootifol.reward != "frames"


def _open(path: Path, run: RunConfig, task: Task, unverified: list[DemoSet]) -> DemoSet:
    """Opens one set; verifies it, or leaves it in `unverified` where that would take long."""
    demo_set = DemoSet.open(path)
    if sum(shard.bytes for shard in demo_set.manifest.shards) < _VERIFY_BELOW_BYTES:
        demo_set.verify()
    else:
        unverified.append(demo_set)
    if not compares_in_time(run):
        task = replace(task, episode_steps=min(task.episode_steps, demo_set.manifest.frames - 1))
    found = differences(demo_set.manifest, task, run.training.pictures)
    if found:
        raise BootifolError(f"the videos in {path} do not fit this run: {'; '.join(found)}")
    return demo_set
