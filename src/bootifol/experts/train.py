"""Experts trained from states with stable-baselines3: `bootifol experts train`. Needs the extra `experts`.

This is the only place that learns from the environment's reward besides the `environment` method: it makes the
performers of demonstrations, and nothing that learns from videos sees more of it than their pictures.
"""

from __future__ import annotations

import csv
import importlib
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import torch
from pydantic import Field, Strict
from torch import Tensor, nn

from bootifol.errors import BootifolError
from bootifol.experts.policy import Layer, StatePolicy
from bootifol.experts.states import StateEnvironment
from bootifol.files import last_whole, read_arrays, read_json, write_arrays, write_json, written_aside
from bootifol.locks import one_writer
from bootifol.progress import progress
from bootifol.settings import Count, Fraction, Number, Positive, Threads, settings
from bootifol.tasks import task_named
from bootifol.types import Arrays

Seed = Annotated[int, Strict(), Field(ge=0, le=2**32 - 1)]
"""What stable-baselines3 takes."""

Algorithm = Literal["SAC", "TQC", "CrossQ"]

EVALUATION_SEED = 10**6
"""Seeds of evaluation starts begin here, so that they are none of `bootifol tasks --measure`."""

_SAME_TO_START = ("task", "algorithm", "hidden_dims")
"""What a training must have in common with the one that it starts from: the checkpoint fits no other."""

COLUMNS = ("agent_steps", "seconds", "mean_return", "lowest_return")


@dataclass(frozen=True)
@settings("experts")
class ExpertConfig:
    """How an expert is trained; what is not here is the library's default."""

    task: str
    algorithm: Algorithm = "SAC"
    hidden_dims: tuple[int, ...] = (256, 256)
    """Widths of the hidden layers, of actor and critics."""
    agent_steps: Count = 500_000
    seed: Seed = 1
    discount: Fraction = 0.99
    learning_rate: Positive = 3e-4
    agent_steps_per_update: Count = 1
    """Agent steps for each update of actor and critics; an update takes many times as long as a step."""
    n_step: Count = 1
    """Agent steps whose rewards are summed before critics estimate the rest; rare rewards spread faster with 3."""
    episode_steps: Count | None = None
    """Agent steps of a training episode; the task's evaluation length by default. Shorter ones show more starts, which
    is what rare rewards need; what would come later is estimated by the critics."""
    target_entropy: float | None = None
    """Entropy in nats that the noise of actions is steered to; minus the number of action dimensions by default. With
    less of it the mean action, which is what is kept, can do what noise would ruin."""
    shaping: Number = 0.0
    """Weight of a potential in the reward that is learned from, not in the returns of evaluations: in hopper_stand the
    height of the torso, without which no reward says how to rise."""
    evaluation_every: Count = 10_000
    """Agent steps between two evaluations; each also writes a checkpoint."""
    evaluation_episodes: Count = 20
    """From starts that are the same every time, and many enough that the best evaluation is not the luckiest."""
    threads: Threads = 1


def train_expert(config: ExpertConfig, out: Path, start_from: Path | None = None) -> StatePolicy:
    """Trains an expert and keeps the best policy that an evaluation saw.

    Args:
        config: see there.
        out: directory of the training; the same call goes on with what is there.
        start_from: directory of another training of the task, with the same algorithm and networks, from whose
            checkpoint and replay this one begins. `training.json` keeps what it was trained with under `before`.

    In `out`: `expert.safetensors` (the policy), `half_trained.safetensors` (the one whose return was nearest to half of
    its), `curve.csv` (an evaluation a row), `training.json` (configuration and versions), `policies/` (the policy of
    every evaluation), `checkpoint/` (with which the same call goes on).

    Raises:
        BootifolError: stable-baselines3 is missing, `out` holds the training of another expert or one without its
            checkpoint, another process writes there, or what is started from does not fit.
    """
    with one_writer(out, out.parent / f".{out.name}.lock"):
        return _train(config, out, start_from)


def _train(config: ExpertConfig, out: Path, start_from: Path | None) -> StatePolicy:
    torch.set_num_threads(config.threads)
    if start_from is not None and not (out / "training.json").exists():
        _start_from(start_from, config, out)
    _check_same(config, out)
    steps = task_named(config.task).evaluation_steps
    environment = StateEnvironment(
        config.task, config.episode_steps or steps, config.shaping, config.discount
    )
    judged = StateEnvironment(config.task, steps)
    model = _make_model(config, environment)
    rows = _read_rows(out / "curve.csv")
    checkpoint = last_whole(out / "checkpoint")
    if checkpoint.is_dir():
        _load_checkpoint(checkpoint, model)
    elif rows:
        raise BootifolError(
            f"{out} has no checkpoint to go on from, and to begin anew would lose its curve.csv: copy its checkpoint/ "
            "there, or choose another --out"
        )
    rows = [row for row in rows if int(row["agent_steps"]) <= model.num_timesteps]
    best = max((float(row["mean_return"]) for row in rows), default=-np.inf)
    seconds = float(rows[-1]["seconds"]) if rows else 0.0
    with progress(f"training an expert in {config.task}", config.agent_steps, model.num_timesteps) as advance:
        while (done := model.num_timesteps) < config.agent_steps:
            started = time.monotonic()
            with _bfloat16_products():
                model.learn(
                    min(config.evaluation_every, config.agent_steps - done),
                    reset_num_timesteps=False,
                    progress_bar=False,
                )
            seconds += time.monotonic() - started
            policy = extract_policy(model.actor)
            returns = evaluate_policy(policy, judged, config.evaluation_episodes)
            rows.append(
                {
                    "agent_steps": str(model.num_timesteps),
                    "seconds": f"{seconds:.0f}",
                    "mean_return": f"{np.mean(returns):.2f}",
                    "lowest_return": f"{np.min(returns):.2f}",
                }
            )
            best = max(best, float(np.mean(returns)))
            (out / "policies").mkdir(exist_ok=True)
            policy.save(_policy_path(out, rows[-1]))
            _write_rows(out / "curve.csv", rows)
            _keep_nearest(out, rows, best, "expert")
            _keep_nearest(out, rows, 0.5 * best, "half_trained")
            _save_checkpoint(out / "checkpoint", model)
            advance(model.num_timesteps - done, mean_return=float(np.mean(returns)), best=best)
    return StatePolicy.load(out / "expert.safetensors")


@contextmanager
def _bfloat16_products() -> Iterator[None]:
    """Matrix products of bfloat16 factors and float32 sums; parameters stay float32. 1.3 times as fast."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


def _policy_path(out: Path, row: dict[str, str]) -> Path:
    return out / "policies" / f"{row['agent_steps']}.safetensors"


def _keep_nearest(out: Path, rows: list[dict[str, str]], mean_return: float, name: str) -> None:
    """Keeps the policy of the evaluation with the mean return nearest to this one under a name."""
    nearest = min(rows, key=lambda row: abs(float(row["mean_return"]) - mean_return))
    StatePolicy.load(_policy_path(out, nearest)).save(out / f"{name}.safetensors")


def evaluate_policy(
    policy: StatePolicy, environment: StateEnvironment, episodes: int, first_seed: int = EVALUATION_SEED
) -> list[float]:
    """Returns of so many episodes from fixed starts, whose seeds count from the first."""
    returns = []
    for seed in range(first_seed, first_seed + episodes):
        state, _ = environment.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            state, reward, terminated, truncated, _ = environment.step(policy(state))
            total += reward
            over = terminated or truncated
        returns.append(total)
    return returns


def extract_policy(actor: Any) -> StatePolicy:
    """The mean action of a stable-baselines3 actor as plain layers; batch normalization is folded into them."""
    layers: list[Layer] = []
    scale: np.ndarray | None = None
    shift: np.ndarray | None = None
    for module in [*actor.latent_pi, actor.mu]:
        if isinstance(module, nn.Linear):
            weight, bias = _numpy(module.weight), _numpy(module.bias)
            if scale is not None and shift is not None:
                weight, bias = weight * scale, bias + weight @ shift
            layers.append((weight, bias))
            scale = shift = None
        elif hasattr(module, "ra_mean"):
            scale = _numpy(module.scale) / np.sqrt(_numpy(module.ra_var) + module.eps)
            shift = _numpy(module.bias) - _numpy(module.ra_mean) * scale
        elif not isinstance(module, nn.ReLU | nn.Flatten):
            raise TypeError(f"an expert's network may hold linear layers and ReLUs, not {module}")
    return StatePolicy(layers)


def _make_model(config: ExpertConfig, environment: StateEnvironment) -> Any:
    try:
        package = importlib.import_module("stable_baselines3" if config.algorithm == "SAC" else "sb3_contrib")
    except ImportError as error:
        raise BootifolError(
            f"training an expert needs stable-baselines3 and sb3-contrib ({error}): "
            "pip install 'bootifol[experts]'"
        ) from error
    optimizer: dict[str, Any] = {"fused": True}
    if config.algorithm == "CrossQ":
        optimizer["betas"] = (0.5, 0.999)  # CrossQ's own, which giving any option of the optimizer would lose
    return getattr(package, config.algorithm)(
        "MlpPolicy",
        environment,
        policy_kwargs={"net_arch": list(config.hidden_dims), "optimizer_kwargs": optimizer},
        train_freq=config.agent_steps_per_update,
        learning_rate=config.learning_rate,
        gamma=config.discount,
        n_steps=config.n_step,
        buffer_size=config.agent_steps,
        learning_starts=min(5000, config.agent_steps // 10),
        seed=config.seed,
        device="cpu",
        target_entropy="auto" if config.target_entropy is None else config.target_entropy,
    )


def _start_from(before: Path, config: ExpertConfig, out: Path) -> None:
    """Copies a training as the beginning of this one."""
    description = read_json(before / "training.json", "the training to start from")
    settings = asdict(ExpertConfig(config.task)) | description["config"]
    differing = [name for name in _SAME_TO_START if settings[name] != _plain(config)[name]]
    if differing:
        raise BootifolError(
            f"{before} cannot be started from: its {', '.join(differing)} "
            f"{'is' if len(differing) == 1 else 'are'} different"
        )
    if not (before / "checkpoint").is_dir():
        raise BootifolError(
            f"{before} has no checkpoint to start from: give it time for its first evaluation"
        )
    if out.is_dir() and any(out.iterdir()):
        raise BootifolError(f"{out} is not empty and holds no training: choose another directory")
    with written_aside(out) as aside:
        aside.mkdir()
        for name in ("checkpoint", "policies"):
            shutil.copytree(before / name, aside / name)
        shutil.copyfile(before / "curve.csv", aside / "curve.csv")
        counts = read_json(before / "checkpoint" / "counts.json", "the expert's checkpoint")
        _describe(config, aside, description | {"agent_steps": counts["num_timesteps"]})


def _plain(config: ExpertConfig) -> dict[str, Any]:
    return asdict(config) | {"hidden_dims": list(config.hidden_dims)}


def _describe(config: ExpertConfig, out: Path, before: Any) -> None:
    versions = {
        name: importlib.import_module(name).__version__ for name in ("torch", "gymnasium", "mujoco", "numpy")
    }
    described = {"config": _plain(config), "versions": versions}
    write_json(out / "training.json", described if before is None else described | {"before": before})


def _check_same(config: ExpertConfig, out: Path) -> None:
    """Writes `training.json`, or compares with the one that is there; what no update depends on may change."""
    path = out / "training.json"
    now = _plain(config)
    started_from = None
    if path.exists():
        described = read_json(path, "the expert's training")
        started_from = described.get("before")
        before = asdict(ExpertConfig(config.task)) | described["config"]
        changed = [
            name
            for name in now
            if name not in ("agent_steps", "evaluation_episodes", "threads") and before[name] != now[name]
        ]
        if changed:
            raise BootifolError(
                f"{out} holds the training of another expert (different: {', '.join(changed)}): choose "
                "another directory, or the same settings to go on with it"
            )
    _describe(config, out, started_from)


def _save_checkpoint(directory: Path, model: Any) -> None:
    arrays: Arrays = {}
    for name, state in model.get_parameters().items():
        if name.endswith("optimizer"):
            for index, values in state["state"].items():
                arrays |= {f"{name}/{index}/{key}": _array(value) for key, value in values.items()}
        else:
            arrays |= {f"{name}/{key}": _array(value) for key, value in state.items()}
    arrays["log_ent_coef"] = _array(model.log_ent_coef)
    buffer = model.replay_buffer
    filled = buffer.buffer_size if buffer.full else buffer.pos
    for name in ("observations", "next_observations", "actions", "rewards", "dones", "timeouts"):
        arrays[f"replay/{name}"] = getattr(buffer, name)[:filled]
    with written_aside(directory) as aside:
        aside.mkdir()
        write_arrays(aside / "arrays.safetensors", arrays)
        counts = {
            "num_timesteps": model.num_timesteps,
            "updates": model._n_updates,
        }
        write_json(aside / "counts.json", counts)


def _load_checkpoint(directory: Path, model: Any) -> None:
    arrays = read_arrays(directory / "arrays.safetensors", "the expert's checkpoint")
    counts = read_json(directory / "counts.json", "the expert's checkpoint")
    parameters = model.get_parameters()
    for name, state in parameters.items():
        found = {
            key.removeprefix(f"{name}/"): torch.from_numpy(array)
            for key, array in arrays.items()
            if key.startswith(f"{name}/")
        }
        if name.endswith("optimizer"):
            state["state"] = {}
            for key, value in found.items():
                index, _, part = key.partition("/")
                state["state"].setdefault(int(index), {})[part] = value
        else:
            parameters[name] = found
    model.set_parameters(parameters, exact_match=False)
    with torch.no_grad():
        model.log_ent_coef.copy_(torch.from_numpy(arrays["log_ent_coef"]))
    buffer = model.replay_buffer
    held = len(arrays["replay/rewards"])
    if held > buffer.buffer_size:
        raise BootifolError(
            f"{directory} holds {held} agent steps, more than the {buffer.buffer_size} to train for: pass "
            f"--agent-steps {held} or more"
        )
    for name in ("observations", "next_observations", "actions", "rewards", "dones", "timeouts"):
        stored = arrays[f"replay/{name}"]
        getattr(buffer, name)[: len(stored)] = stored
    # Not where it stood: a replay that was full may have more room now.
    buffer.pos, buffer.full = held % buffer.buffer_size, held == buffer.buffer_size
    model.num_timesteps, model._n_updates = counts["num_timesteps"], counts["updates"]


def _read_rows(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def _write_rows(path: Path, rows: list[dict[str, str]]) -> None:
    with written_aside(path) as aside, aside.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


def _numpy(tensor: Tensor) -> np.ndarray:
    return tensor.detach().cpu().double().numpy()


def _array(value: Any) -> np.ndarray:
    return torch.as_tensor(value).detach().cpu().numpy().copy()
