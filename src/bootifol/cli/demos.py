"""`bootifol demos record | import | check | match | export`: videos in and out."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from bootifol.cli.arguments import DemosPath, VideoPaths
from bootifol.demos.manifest import Manifest
from bootifol.demos.matching import Match
from bootifol.errors import STOPPED, BootifolError, warn


def record(
    task: str,
    out: Path,
    episodes: int = 200,
    behaviors: tuple[Literal["expert", "half_good", "random", "still"], ...] | None = None,
    seed: int = 1,
    episode_steps: int | None = None,
    action_repeat: int | None = None,
    agent_size: int = 64,
    video_size: int = 64,
    profile: Literal["fast", "balanced", "full"] = "fast",
    workers: int = 1,
    policy: str | None = None,
) -> int:
    """Record videos of a task's bundled expert, or of a policy of yours, and of others for comparison.

    Each behavior becomes a demo set of its own: OUT/expert, OUT/random (the method learns to tell it from the expert)
    and OUT/half_good (at most 64 videos, to see whether the learned reward ranks them between the two). Pictures only:
    no actions and no rewards. Stop it whenever you like: the same command goes on where it stopped.

    Args:
        task: What to perform: a name that `bootifol tasks` lists, gymnasium:ID, or MODULE:FUNCTION.
        out: Directory of the demo sets, the one to give to `bootifol train --demos`.
        episodes: Videos of each behavior.
        behaviors: Who performs; by default expert, random and half_good, or random alone where no expert is bundled.
        seed: The same seed records the same videos, to the byte.
        episode_steps: Agent steps of a video; the task's training episode by default.
        action_repeat: Simulator steps an agent step; the task's own by default. Training must use the same.
        agent_size: Height and width, in pixels, of the agent's pictures in training (the larger size is rendered).
        video_size: Height and width of the videos, in pixels.
        profile: Render quality; training must use the same. fast costs a tenth of full.
        workers: Processes that record side by side; the videos are the same for any number.
        policy: Who plays the expert in a Gymnasium environment: MODULE:FUNCTION, a function of yours that is called
            with what the environment observes and returns an action of it.
    """
    # Imported here: the simulators would slow down every other command's help.
    from bootifol.demos.record import record_demos
    from bootifol.envs.pictures import PictureConfig

    if behaviors == ():
        raise BootifolError("name at least one behavior, such as --behaviors expert random")
    pictures = PictureConfig(agent_size=agent_size, video_size=video_size, profile=profile)
    try:
        recorded = record_demos(
            task, out, episodes, behaviors, pictures, seed, episode_steps, workers, action_repeat, policy
        )
        for behavior, demo_set in recorded.items():
            print(f"{out / behavior}: {_summary(demo_set.manifest)}")
    except KeyboardInterrupt:
        print("\nstopped; run the same command again and it goes on where it stopped")
        return STOPPED
    if "half_good" in (behaviors or ()) and "half_good" not in recorded:
        print(f"half_good videos were left out: no expert is bundled for {task} to be half as good as")
    lengths = {"episode-steps": episode_steps, "action-repeat": action_repeat}
    others = "".join(f" --{name} {value}" for name, value in lengths.items() if value is not None)
    before = (
        f"demos check {out}{f' --task {task}{others}' if others else ''}"
        if "expert" in recorded
        else f"demos import YOUR_VIDEOS --out {out}"
    )
    manifest = next(iter(recorded.values())).manifest
    print(f"next: bootifol {before}, then bootifol {_train_words(task, out, manifest)}{others}")
    return 0


def import_(
    videos: VideoPaths,
    out: Path,
    task: str | None = None,
    action_repeat: int | None = None,
    frames: int | None = None,
    size: int = 64,
    crop: tuple[int, int, int] | None = None,
    fps: float | None = None,
    windows: Literal["all", "first"] = "all",
    behavior: Literal["expert", "half_good", "random"] = "expert",
    camera: str | None = None,
) -> int:
    """Make a demo set from your own videos: mp4, mov, webm, avi, gif … files, folders of pictures, .npy arrays.

    A .npz archive may hold one such array among others. A LeRobot dataset of format v3 (its directory) gives one
    video an episode: its pictures alone, never its actions or states. hf://datasets/USER/NAME fetches such files, or
    such a dataset, from the Hugging Face hub; @REVISION and /FOLDER may follow the name.

    A square of every picture, the largest centered one by default, is cut out and resized, after turning it upright,
    stretching pixels that are not square, and putting white behind what is transparent. What was done to which file is
    written down in OUT/BEHAVIOR/manifest.json, and OUT/BEHAVIOR/contact_sheet.png shows the result.

    Args:
        videos: Files, and folders of them at any depth; a folder of pictures is one video.
        out: Directory of the demo sets, the one to give to `bootifol train --demos`.
        task: What the videos show; its environment says --fps and --frames, unless they are given.
        action_repeat: Simulator steps an agent step, with --task, if training shall have others than the task's own.
        frames: Frames of each video: the agent steps of the task's training episode, plus 1; 61 without --task.
        size: Height and width of the pictures, in pixels.
        crop: LEFT TOP SIDE: the square to cut out, in pixels of the upright picture.
        fps: Pictures per second, which should be the environment's; without it and --task every picture is kept.
        windows: all cuts a long file into one video after another; first takes the beginning of each file.
        behavior: What the videos show.
        camera: Which camera of a LeRobot dataset to take, when it has several.
    """
    from bootifol.demos.import_videos import Conversion, import_videos
    from bootifol.tasks import frames_per_second, task_named

    lengths_of_task = task is not None and frames is None
    if task is not None:
        shown = task_named(task, action_repeat)
        frames = shown.episode_steps + 1 if frames is None else frames
        fps = frames_per_second(shown) if fps is None else fps
        if fps is None:
            warn(
                f"{task} does not say how many pictures a second it shows (render_fps), so every picture of the videos "
                "is kept: give --fps where they were filmed at another pace"
            )
    elif action_repeat is not None:
        raise BootifolError("--action-repeat changes the pace of a task: say of which with --task")
    conversion = Conversion(
        frames=Conversion.frames if frames is None else frames,
        size=size,
        crop=crop,
        frames_per_second=fps,
        windows=windows,
    )
    demo_set = import_videos(videos, out / behavior, conversion, behavior, camera=camera)
    manifest = demo_set.manifest
    short = sum(video.length < manifest.frames for video in manifest.videos)
    recordings = sum(video.source["first_frame"] == 0 for video in manifest.videos)
    what = "episode" if all("episode" in video.source for video in manifest.videos) else "file"
    print(f"{demo_set.path}: {_summary(manifest)}, from {_count(recordings, what)}")
    if short:
        shortest = min(video.length for video in manifest.videos)
        because = f", as long as an episode of {task}" if lengths_of_task else ""
        print(
            f"  {short} shorter than {manifest.frames} frames{because}: they stand still on their last picture; "
            f"--frames {max(shortest, 2)} would leave none standing"
        )
    print(f"  look at {demo_set.path / 'contact_sheet.png'}")
    if task is None:
        print(f"next: bootifol demos check {out}  (bootifol tasks lists what --task can compare it with)")
        return 0
    train = _train_words(task, out, manifest)
    repeat = "" if action_repeat is None else f" --action-repeat {action_repeat}"
    print(f"next: bootifol demos check {out} --task {task}{repeat}, then bootifol {train}{repeat}")
    return 0


def check(
    demos: DemosPath,
    task: str | None = None,
    episode_steps: int | None = None,
    action_repeat: int | None = None,
) -> int:
    """Read every byte of recorded or imported videos and say whether they are whole and worth learning from.

    Looks for videos that come twice (also compressed again), that stand still, go blank or change their scene. With a
    task it compares frame rate, length, brightness, color, contrast and camera, and writes first_frames.png beside
    the videos: theirs above the environment's.

    Exits with 0 when all is well, with 1 when the videos do not fit the task, with 2 when they are damaged.

    Args:
        demos: Directory of the demo sets, or one of them.
        task: Also compare with this task and say what to do about each difference.
        episode_steps: Agent steps of an episode of the task, if training shall have others than the task's own.
        action_repeat: Simulator steps an agent step, if training shall have others than the task's own.
    """
    from bootifol.demos.check import check_demo_set
    from bootifol.demos.manifest import find_demo_sets
    from bootifol.tasks import task_named

    compared = None if task is None else task_named(task, action_repeat, episode_steps)
    fits = True
    for path in find_demo_sets(demos).values():
        checked = check_demo_set(path, compared)
        manifest = checked.manifest
        print(f"{path}: {_summary(manifest)}")
        print(
            f"  {checked.bytes_on_disk / 1e6:,.1f} MB in {_count(len(manifest.shards), 'file')}; every checksum agrees"
        )
        print(f"  {_origin(manifest)}")
        for sentence in checked.defects.sentences():
            print(f"  {sentence}")
        for difference in checked.differences:
            print(f"  {difference}")
        if task is not None and not checked.differences:
            print(f"  fits the task {task}")
        if task is not None and checked.looks_differ and manifest.task is None:
            print(
                f"  light, colors, place and background can be repaired: bootifol demos match {demos} --task {task}"
            )
        shown = f" and {checked.first_frames}" if checked.first_frames is not None else ""
        print(f"  look at {checked.contact_sheet}{shown}")
        fits = fits and not checked.differences
    return 0 if fits else 1


def match(
    demos: DemosPath,
    task: str,
    out: Path | None = None,
    repairs: tuple[Literal["crop", "colors", "exposure", "background"], ...] = (
        "crop",
        "colors",
        "exposure",
        "background",
    ),
    episode_steps: int | None = None,
    action_repeat: int | None = None,
) -> int:
    """Bring imported videos toward the pictures of an environment, as a new directory of demo sets.

    What `demos check` finds different is fitted on median pictures, in which what moves does not show, and taken back:
    a square that shows what the environment shows; light and white balance; exposure that changes within a video; and
    a background that is nearly the environment's. Only what brings the pictures nearer is done, and the manifest says
    what. Recorded sets are copied.

    Args:
        demos: Directory of the demo sets, or one of them; it stays as it is.
        task: Whose environment shows how the videos should look.
        out: Directory to write; by default the name of DEMOS and _matched.
        repairs: Which may be made.
        episode_steps: Agent steps of an episode of the task, if training shall have others than the task's own.
        action_repeat: Simulator steps an agent step, if training shall have others than the task's own.
    """
    from bootifol.demos.manifest import read_manifest
    from bootifol.demos.match_set import match_demo_sets
    from bootifol.tasks import task_named

    target = demos.with_name(f"{demos.resolve().name}_matched") if out is None else out
    matched = match_demo_sets(demos, task_named(task, action_repeat, episode_steps), target, repairs)
    for result in matched.values():
        if result.match is None:
            print(f"{result.path}: copied, for it was recorded in an environment")
            continue
        print(f"{result.path}: {_what_was_done(result.match)}")
        print(
            f"  the usual first picture differs from the environment's by {result.after:.1f} levels of 255 instead of "
            f"{result.before:.1f}; look at {result.path / 'first_frames.png'}"
        )
        for sentence in result.remaining:
            print(f"  {sentence}")
    lengths = {"episode-steps": episode_steps, "action-repeat": action_repeat}
    others = "".join(f" --{name} {value}" for name, value in lengths.items() if value is not None)
    train = _train_words(task, target, read_manifest(next(iter(matched.values())).path))
    print(f"next: bootifol demos check {target} --task {task}{others}, then bootifol {train}{others}")
    return 0


def _what_was_done(match: Match) -> str:
    done = []
    if match.crop is not None:
        left, top, side = match.crop
        done.append(f"the square of {side} pixels at {left}, {top} was enlarged")
    if (match.gain, match.offset) != ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)):
        gains, offsets = (
            ", ".join(f"{value:{kind}}" for value in values)
            for values, kind in ((match.gain, ".2f"), (match.offset, "+.0f"))
        )
        done.append(f"red, green and blue were multiplied by {gains} and moved by {offsets} levels")
    if match.usual is not None:
        done.append("each picture was exposed like the others")
    if match.background is not None:
        done.append("the background gave way to the environment's")
    return "; ".join(done) or "nothing was to be done"


def export(
    demos: DemosPath,
    out: Path,
    format: Literal["mp4", "npy", "lerobot"] = "mp4",
    behavior: str = "expert",
    videos: int | None = None,
    fps: float | None = None,
) -> int:
    """Write a demo set's videos as files that other programs read.

    Only frames that were seen are written: a video that ended early is shorter than the set's others.

    Args:
        demos: Directory of the demo sets, or one of them.
        out: Directory to write; it must not exist.
        format: mp4 (one a video, small pictures enlarged), npy (one a video, every pixel as it is) or lerobot (one
            dataset of format v3, without actions and states).
        behavior: Which of the sets.
        videos: Export the first so many; by default all.
        fps: Pictures per second; by default those of the set.
    """
    from bootifol.demos.export_videos import export_videos

    count = export_videos(demos, out, format, behavior, fps, videos)
    print(f"{out}: {_count(count, 'video')} as {format}")
    return 0


def _train_words(task: str, demos: Path, manifest: Manifest) -> str:
    """What to type to learn from videos: with the preset for the task, and the pictures' flags where it needs them."""
    from bootifol.demos.fit import picture_flags
    from bootifol.presets import preset
    from bootifol.tasks import TASKS, short_name

    drawn = task in TASKS and TASKS[task].suite == "drawn with numpy"
    words = ["train", "--task", task, *(["--preset", "drawn"] if drawn else [])]
    words += ["--demos", str(demos), "--out", f"runs/{short_name(task)}"]
    return " ".join([*words, picture_flags(manifest, preset("drawn" if drawn else "cpu").pictures)]).rstrip()


def _summary(manifest: Manifest) -> str:
    rate = manifest.frames_per_second
    seconds = f" ({manifest.frames / rate:.1f} s at {rate:g} a second)" if rate else ""
    size = manifest.video_size
    return (
        f"{_count(len(manifest.videos), 'video')} of {manifest.frames} frames{seconds}, {size}×{size} pixels"
    )


def _origin(manifest: Manifest) -> str:
    if manifest.task is None:
        return f"imported as {manifest.behavior} videos"
    return (
        f"recorded: {manifest.behavior} in {manifest.task}, seed {manifest.seed}; train with "
        f"--pictures.video-size {manifest.video_size} --pictures.agent-size {manifest.agent_size} "
        f"--pictures.profile {manifest.render_profile}"
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
