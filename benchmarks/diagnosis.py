"""Why did a run's policy come out as it did? Three questions about its learned reward, as numbers and plots.

    python -m benchmarks.diagnosis runs/reacher --out results/reacher_hard/diagnosis

1. Does the reward rank performances it never saw, from the expert's down to random ones? Performers of every degree
   play: the expert with a fraction of random actions, late, or with weak actions, and constant actions.
2. Does the agent follow the reward? Its own episodes stand among them; and does the reward tell those that reach the
   goal from those that do not? Where it cannot, it cannot lead the agent from one to the other.
3. Is the reward stale? The rewards that replay holds, against what the newest reward would give the same episodes.

The environment's reward is read to judge the learned one, after training.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from scipy import stats

from benchmarks.command import command
from bootifol.envs.rollout import Act, play_episode
from bootifol.experts import make_expert
from bootifol.files import written_aside
from bootifol.progress import progress
from bootifol.reports.style import house_style
from bootifol.rewards.references import draw_references
from bootifol.training.build import build_environment
from bootifol.training.run_config import RunConfig
from bootifol.training.trainer import Trainer
from bootifol.types import Rewards, Video

Performer = Callable[[int], Act]
"""Makes whoever plays the episode of that seed."""


@dataclass(frozen=True)
class Performance:
    """One episode, judged twice."""

    performer: str
    environment_return: float
    rewards: Rewards
    """The learned reward's, `[T]`."""


def performers(task: str, environment: gymnasium.Env[Any, Any]) -> dict[str, Performer]:
    """From the expert down, by name."""
    assert environment.action_space.shape is not None
    size = environment.action_space.shape[0]

    def expert(noise: float = 0.0, late: int = 0, strength: float = 1.0) -> Performer:
        def make(seed: int) -> Act:
            rng, controller, step = (
                np.random.default_rng(seed),
                make_expert(task, environment),
                iter(range(10**9)),
            )

            def act(observation: NDArray[np.uint8]) -> NDArray[np.float32]:
                if next(step) < late or rng.random() < noise:
                    return rng.uniform(-1.0, 1.0, size).astype(np.float32)
                return strength * controller(observation)

            return act

        return make

    def constant(seed: int) -> Act:
        action = np.random.default_rng(seed).uniform(-1.0, 1.0, size).astype(np.float32)
        return lambda observation: action

    return {
        "expert": expert(),
        "expert, 1/4 random": expert(noise=0.25),
        "expert, 1/2 random": expert(noise=0.5),
        "expert, 3/4 random": expert(noise=0.75),
        "expert, 10 steps late": expert(late=10),
        "expert, 20 steps late": expert(late=20),
        "expert at 0.3 strength": expert(strength=0.3),
        "random": expert(noise=1.0),
        "constant actions": constant,
    }


def judged(run: Trainer, episodes: int, agent_episodes: int) -> Iterator[Performance]:
    """Plays every performer, the agent last."""
    environment = build_environment(run.config, run.task.episode_steps)
    model, agent = run.parts.reward_model, run.parts.agent
    rng = np.random.default_rng(0)
    steps = run.budget.scheduled_steps(run.counters)
    cast = performers(run.config.task, environment)
    cast["agent"] = lambda seed: lambda observation: agent.act(observation, steps, explore=False)
    for name, make in cast.items():
        for seed in range(agent_episodes if name == "agent" else episodes):
            played = play_episode(environment, make(seed), 10**6 + seed, f"{name}-{seed}")
            rewards = model.label(played.episode.video, draw_references(model, run.parts.demos.expert, rng))
            yield Performance(name, played.environment_return, rewards)


def staleness(run: Trainer, episodes: int) -> NDArray[np.float64]:
    """Mean rewards a step `[n, 2]` of stored episodes of every age: as replay holds them, and as given now."""
    replay, videos, model = run.parts.replay, run.parts.agent_videos, run.parts.reward_model
    rng = np.random.default_rng(0)
    stored = replay.state()
    both = min(len(videos), len(replay.episode_ids))
    newest = videos.newest(both)
    starts, lengths = stored["episode_starts"][-both:], stored["episode_lengths"][-both:]
    pairs = []
    for index in np.unique(np.linspace(0, both - 1, min(episodes, both)).astype(int)):
        steps = int(lengths[index])
        held = stored["rewards"][(starts[index] + np.arange(steps)) % replay.capacity].mean()
        video = Video(f"{newest[index].name}-now", newest[index].frames[: steps + 1])
        pairs.append((held, model.label(video, draw_references(model, run.parts.demos.expert, rng)).mean()))
    return np.array(pairs, np.float64)


@command()
def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, help="directory that `bootifol train` wrote")
    parser.add_argument("--episodes", type=int, default=10, help="of each performer")
    parser.add_argument("--agent-episodes", type=int, default=40, help="of the agent")
    parser.add_argument("--out", type=Path, required=True, help="writes OUT.csv and OUT.png")
    arguments = parser.parse_args()
    run = Trainer(RunConfig.read(arguments.run), arguments.run, Console(stderr=True))
    performances: list[Performance] = []
    with progress("judging", total=9 * arguments.episodes + arguments.agent_episodes) as advance:
        for performance in judged(run, arguments.episodes, arguments.agent_episodes):
            performances.append(performance)
            advance(1)
    pairs = staleness(run, 200)

    returns = np.array([p.environment_return for p in performances])
    learned = np.array([p.rewards.sum() for p in performances])
    scripted = np.array([p.performer not in ("expert", "agent") for p in performances])
    rank = stats.spearmanr(learned[scripted], returns[scripted]).statistic
    stale = stats.spearmanr(*pairs.T).statistic
    console = Console()
    for name in dict.fromkeys(p.performer for p in performances):
        of_name = np.array([p.performer == name for p in performances])
        console.print(
            f"{name:24} return {returns[of_name].mean():7.1f}   learned {learned[of_name].mean():7.1f}"
        )
    console.print(f"rank correlation of learned reward and return, expert and agent left out: {rank:.2f}")
    console.print(success_and_failure(performances))
    console.print(f"rank correlation of stored and fresh rewards over {len(pairs)} episodes: {stale:.2f}")

    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    with written_aside(arguments.out.with_suffix(".csv")) as aside, aside.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["performer", "environment_return", "learned_reward"])
        writer.writerows(
            [p.performer, f"{p.environment_return:.4g}", f"{p.rewards.sum():.4g}"] for p in performances
        )
    with written_aside(arguments.out.with_suffix(".png")) as aside:
        draw(performances, pairs, rank, stale, aside)


def success_and_failure(performances: list[Performance]) -> str:
    """How often the reward puts an episode of the agent that earned half of what the expert does above one that did
    not."""
    expert = np.mean([p.environment_return for p in performances if p.performer == "expert"])
    own = [p for p in performances if p.performer == "agent"]
    reached, missed = (
        np.array([p.rewards.sum() for p in own if bool(p.environment_return >= expert / 2) == wanted])
        for wanted in (True, False)
    )
    if not (len(reached) and len(missed)):
        return f"of the agent's {len(own)} episodes {len(reached)} earned half of the expert's return or more"
    above = float((reached[:, None] > missed[None, :]).mean())
    return (
        f"the agent's {len(reached)} episodes that earned half of the expert's return or more are rewarded above its "
        f"{len(missed)} others in {above:.0%} of pairs (chance: 50%)"
    )


def draw(
    performances: list[Performance], pairs: NDArray[np.float64], rank: float, stale: float, path: Path
) -> None:
    """Three panels: learned reward against return, learned reward over time, stored against fresh rewards."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(p.performer for p in performances))
    shades = colormaps["viridis"](np.linspace(0.0, 0.92, len(names) - 1))
    colors = {**dict(zip(names, shades, strict=False)), "agent": "#D55E00"}
    with house_style():
        figure = Figure(figsize=(14.4, 4.2), layout="constrained")
        across, along, fresh = figure.subplots(1, 3, width_ratios=(1.2, 1.2, 0.9))
        for name in names:
            of_name = [p for p in performances if p.performer == name]
            across.scatter(
                [p.environment_return for p in of_name],
                [p.rewards.sum() for p in of_name],
                s=26,
                color=colors[name],
                label=name,
                alpha=0.85,
            )
            along.plot(np.mean([p.rewards for p in of_name], axis=0), color=colors[name])
        across.set(xlabel="true return of the episode", ylabel="learned reward, summed")
        across.set_title(f"ranks? Spearman {rank:.2f} (expert, agent left out)", loc="left")
        figure.legend(loc="outside right center", fontsize=8)
        along.set(xlabel="agent step", ylabel="learned reward, mean")
        along.set_title("when does it tell them apart?", loc="left")
        if len(pairs):
            fresh.scatter(*pairs.T, s=14, color="#D55E00", alpha=0.6)
            ends = [pairs.min(), pairs.max()]
            fresh.plot(ends, ends, color="#8B929B", linewidth=1.0)
        fresh.set(xlabel="reward a step as replay holds it", ylabel="given now")
        fresh.set_title(f"stale? Spearman {stale:.2f}", loc="left")
        figure.savefig(path, dpi=110, format="png")


if __name__ == "__main__":
    raise SystemExit(main())
