"""`bootifol doctor`: what this machine can do."""

from __future__ import annotations

import os
import platform
import re
import statistics
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import get_args

import numpy as np
from rich.console import Console
from rich.table import Table

from bootifol.envs.pictures import PictureConfig, RenderProfile
from bootifol.errors import BootifolError
from bootifol.experts import make_random
from bootifol.tasks import make_environment

_SIMULATORS = {"dm-control": "reacher_hard", "metaworld": "button_press"}
"""Simulators by the package that brings them, which is also the name of the extra, and a task to try each with."""
_OF_SIMULATORS = (*_SIMULATORS, "mujoco")
_DRAWN_TASK = "drawn_reach"
"""Needs no simulator."""
_PICTURE_SIZE = 64
_STEPS = 12
_FRAMES = 61
_ACTION_DIM = 2
_TURNS = 2
_MATRIX_SIZE = 512
_DRAWN: dict[RenderProfile, str] = {
    "fast": "no shadows, no reflections; smoothed by averaging",
    "balanced": "coarse shadows",
    "full": "all that the simulator offers",
}


def doctor() -> int:
    """Say whether this machine can train: versions, cores, memory, the speed of learning and of rendering.

    Exits with 0 when it can, and with 2 and what to install when something is missing.
    """
    console = Console()
    versions, missing = installed()
    table = Table("package", "version", "needed", title="Versions", title_justify="left")
    table.add_row("python", platform.python_version(), ">=3.11")
    for name, (version, needed) in versions.items():
        table.add_row(name, version or "[bold red]missing[/]", needed)
    console.print(table)
    if missing:
        raise BootifolError(
            f"packages are missing: {', '.join(missing)}; type `pip install "
            + " ".join(f"'{name}{versions[name][1]}'" for name in missing)
            + "`"
        )

    table = Table("what", "measured", title="Machine", title_justify="left")
    for what, measured in machine():
        table.add_row(what, measured)
    console.print(table)

    from bootifol.devices import usable_cores

    table = Table(
        "--threads",
        "ms an update of the agent",
        "ms a gradient step of the reward",
        title="Learning with the preset cpu",
        title_justify="left",
    )
    by_threads = milliseconds_by_threads(thread_counts(usable_cores()))
    for threads, (update, reward_step) in by_threads.items():
        table.add_row(str(threads), f"{update:.0f}", f"{reward_step:.0f}")
    console.print(table)
    console.print(
        f"one run on this machine: --threads {advised_threads(by_threads)}; several at once: --threads 1\n"
    )

    there = [name for name in _SIMULATORS if _version(name)]
    for name in there:
        _show_pictures(console, _SIMULATORS[name])
    for name in sorted(set(_SIMULATORS) - set(there)):
        console.print(f"{name} is not installed; its tasks need `pip install 'bootifol\\[{name}]'`")
    if not there:
        _show_pictures(console, _DRAWN_TASK)
    console.print("this machine can record videos and train")
    return 0


def _show_pictures(console: Console, task: str) -> None:
    profiles: tuple[RenderProfile, ...] = get_args(RenderProfile)
    if task == _DRAWN_TASK:  # drawn by numpy, alike in every profile
        profiles = profiles[:1]
    table = Table(
        "render profile",
        "ms an agent step",
        "what it draws",
        title=f"Pictures of {task}, {_PICTURE_SIZE}×{_PICTURE_SIZE}",
        title_justify="left",
    )
    for profile in profiles:
        table.add_row(profile, f"{milliseconds_per_step(task, profile):.1f}", _DRAWN[profile])
    console.print(table)


def installed() -> tuple[dict[str, tuple[str | None, str]], list[str]]:
    """The packages that bootifol needs, and the simulators that are there.

    Returns:
        By name, the version (None where missing) and what is needed, such as ">=3.3"; and the missing names.
    """
    versions: dict[str, tuple[str | None, str]] = {"bootifol": (metadata.version("bootifol"), "")}
    for requirement in metadata.requires("bootifol") or []:
        match = re.match(r"([\w.-]+)\s*([^;]*)", requirement)
        assert match is not None, requirement
        name, needed = match[1], match[2].strip()
        if "extra ==" not in requirement or (name in _OF_SIMULATORS and _version(name)):
            versions[name] = (_version(name), needed)
    return versions, [name for name, (version, _) in versions.items() if version is None]


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def machine() -> list[tuple[str, str]]:
    """Rows about cores, memory and arithmetic."""
    import torch

    from bootifol.devices import chosen_device, usable_cores

    rows = [("cores", f"{usable_cores()} ({torch.get_num_threads()} used by PyTorch)")]
    memory = _memory_bytes()
    if memory is not None:
        rows.append(("memory", f"{memory / 2**30:.1f} GB"))
    device = chosen_device("auto")
    if device != "cpu":
        device += f", {torch.cuda.get_device_name()}; not tried yet: --device cpu computes as ever"
    rows.append(("device auto means", device))
    ratio = bf16_speed()
    advice = "worth using" if ratio > 1.2 else "no gain: keep precision at fp32"
    rows.append(("bf16 against fp32", f"matrix products {ratio:.1f} times as fast ({advice})"))
    return rows


def bf16_speed() -> float:
    """How many times as fast as in fp32 a matrix product is in bf16, on the CPU."""
    import torch

    fp32 = torch.randn(_MATRIX_SIZE, _MATRIX_SIZE)
    bf16 = fp32.to(torch.bfloat16)
    return _seconds(lambda: fp32 @ fp32) / _seconds(lambda: bf16 @ bf16)


def thread_counts(cores: int) -> list[int]:
    """1, 2, 4 and so on, and all cores."""
    return sorted({2**power for power in range(cores.bit_length()) if 2**power <= cores} | {cores})


def advised_threads(measured: dict[int, tuple[float, float]]) -> int:
    """The fewest threads with which an update of the agent takes at most a tenth longer than at best.

    Args:
        measured: milliseconds of an update of the agent and of a gradient step of the reward, by threads.
    """
    quickest = min(update for update, _ in measured.values())
    return min(threads for threads, (update, _) in measured.items() if update <= 1.1 * quickest)


def milliseconds_by_threads(counts: list[int]) -> dict[int, tuple[float, float]]:
    """Time of an update of the agent and of a gradient step of the reward on the CPU, with the preset `cpu`.

    Args:
        counts: of the threads to try. They take turns, so that other work on the machine slows all alike.
    """
    import torch

    from bootifol.agents.drqv2 import DrQv2
    from bootifol.presets import CPU
    from bootifol.replay.agent_videos import AgentVideos
    from bootifol.rewards.bootifol.model import BootifolRewardModel
    from bootifol.types import Batch, Video

    pictures, batch_size = CPU.pictures, CPU.agent.batch_size
    agent = DrQv2(CPU.agent, pictures.agent_size, pictures.stack, _ACTION_DIM, seed=0)
    reward = BootifolRewardModel(CPU.reward.bootifol, pictures.video_size, seed=0)
    rng = np.random.default_rng(0)
    shape = (batch_size, pictures.agent_size, pictures.agent_size, 3 * pictures.stack)
    seen, seen_next = (
        torch.from_numpy(rng.integers(0, 256, shape, dtype=np.uint8)).permute(0, 3, 1, 2) for _ in range(2)
    )
    rewards = torch.zeros(batch_size)
    batch = Batch(seen, torch.zeros(batch_size, _ACTION_DIM), rewards, rewards, seen_next)
    size, count = pictures.video_size, CPU.reward.bootifol.videos_per_class
    videos = AgentVideos(count, _FRAMES, size)
    for index in range(count):
        videos.add(Video(str(index), rng.integers(0, 256, (_FRAMES, size, size, 3), dtype=np.uint8)))
    works = (lambda: agent.update(batch, 0.0), lambda: reward.update(videos, videos))
    before = torch.get_num_threads()
    times: dict[int, list[list[float]]] = {threads: [[] for _ in works] for threads in counts}
    try:
        for threads in counts * _TURNS:
            torch.set_num_threads(threads)
            for work, taken in zip(works, times[threads], strict=True):
                taken.append(1000.0 * _seconds(work, repetitions=1))
    finally:
        torch.set_num_threads(before)
    return {threads: (min(update), min(step)) for threads, (update, step) in times.items()}


def milliseconds_per_step(task: str, profile: RenderProfile) -> float:
    """Median time of an agent step with its picture.

    Raises:
        BootifolError: pictures cannot be rendered here.
    """
    pictures = PictureConfig(agent_size=_PICTURE_SIZE, video_size=_PICTURE_SIZE, profile=profile)
    environment = make_environment(task, pictures, _STEPS)
    act = make_random(environment, seed=0)
    observation, _ = environment.reset(seed=0)
    times = []
    for _ in range(_STEPS):
        started = time.perf_counter()
        observation, *_ = environment.step(act(observation))
        times.append(time.perf_counter() - started)
    environment.close()
    if np.ptp(observation) == 0:
        raise BootifolError(
            "MuJoCo renders, but every pixel is the same; the OpenGL driver does not work: choose another with the "
            "environment variable MUJOCO_GL (egl, osmesa or glfw)"
        )
    return 1000.0 * statistics.median(times)


def _seconds(work: Callable[[], object], repetitions: int = 5) -> float:
    """The best of a few, after a first one to warm up."""
    work()
    times = []
    for _ in range(repetitions):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def _memory_bytes() -> int | None:
    """The machine's memory, or the container's limit where that is lower; None where unknown."""
    if "SC_PHYS_PAGES" not in getattr(os, "sysconf_names", {}):
        return None
    total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit = Path("/sys/fs/cgroup/memory.max")
    if limit.is_file() and (text := limit.read_text().strip()).isdigit():
        total = min(total, int(text))
    return total
