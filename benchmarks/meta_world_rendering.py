"""How long one picture of a Meta-World task takes: Meta-World's own rendering against our render profiles.

    python -m benchmarks.meta_world_rendering --size 64

The renderers take turns, so that what else the machine does slows all of them alike.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any, get_args

from benchmarks.command import command
from bootifol.envs.meta_world import CAMERA, MetaWorldSimulator, load_meta_world
from bootifol.envs.pictures import PictureConfig, RenderProfile


def own_renderer(name: str, size: int) -> Callable[[], Any]:
    """Meta-World's rendering, from the same camera and at the same size."""
    environment = load_meta_world("env_dict").ALL_V3_ENVIRONMENTS[name](
        render_mode="rgb_array", camera_name=CAMERA, width=size, height=size
    )
    render: Callable[[], Any] = environment.render
    return render


@command()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--size", type=int, default=64, help="height and width of the pictures in pixels")
    parser.add_argument("--turns", type=int, default=15, help="pictures of each renderer")
    arguments = parser.parse_args()
    for name in ("button-press-v3", "plate-slide-v3", "drawer-close-v3"):
        profiles: tuple[RenderProfile, ...] = get_args(RenderProfile)
        renderers = {
            profile: MetaWorldSimulator(name, PictureConfig(arguments.size, arguments.size, profile=profile))
            for profile in profiles
        }
        draw: dict[str, Callable[[], Any]] = {
            "Meta-World": own_renderer(name, arguments.size),
            **{profile: simulator.render for profile, simulator in renderers.items()},
        }
        times: dict[str, list[float]] = {who: [] for who in draw}
        for simulator in renderers.values():
            simulator.reset(0)
        for turn in range(arguments.turns + 1):
            for who, render in draw.items():
                started = time.perf_counter()
                render()
                # The first picture of each warms it up.
                if turn:
                    times[who].append(time.perf_counter() - started)
        medians = {who: 1000.0 * statistics.median(seconds) for who, seconds in times.items()}
        for who, milliseconds in medians.items():
            ratio = medians["Meta-World"] / milliseconds
            print(f"{name:16} {who:10} {milliseconds:7.1f} ms a picture, {ratio:5.1f} times as fast")
        for simulator in renderers.values():
            simulator.close()


if __name__ == "__main__":
    raise SystemExit(main())
