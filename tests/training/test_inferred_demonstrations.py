"""Expert videos as experience: what is inferred from them, what is drawn, what the warm-up gives to learn from."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_runs import INFERRING, WITH_DEMONSTRATIONS, new_run

from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import DrQv2
from bootifol.agents.inverse_dynamics import InverseDynamics
from bootifol.errors import BootifolError
from bootifol.replay.buffer import ReplayBuffer
from bootifol.rewards.bootifol.frames.model import FrameRewardModel
from bootifol.training import inferred_demonstrations
from bootifol.training.budget import Budget, Counters
from bootifol.training.cloning import (
    cloning_due,
    cloning_in_progress,
    cloning_phase,
    one_cycle,
    steps_of_a_phase,
)
from bootifol.training.config import DemonstrationConfig
from bootifol.training.inferred_demonstrations import Demonstrations
from bootifol.types import Arrays, Batch, Episode, FrameBatch, Frames, Metrics, Video, VideoSource

SIZE, STEPS, MOVES = 32, 12, 4
CONFIG = DemonstrationConfig(fraction=0.5)


def sliding_square(seed: int, actions: np.ndarray) -> Frames:
    """A bright square that action 0 slides right, or left where it is negative."""
    frames = np.zeros((len(actions) + 1, SIZE, SIZE, 3), np.uint8)
    rng = np.random.default_rng(seed)
    x, y = float(rng.integers(8, 16)), int(rng.integers(4, 20))
    for frame, move in zip(frames, [*actions[:, 0], 0.0], strict=True):
        frame[y : y + 8, round(x) : round(x) + 8] = 255
        x = float(np.clip(x + 2 * move, 0, 24))
    return frames


class Videos:
    """Videos that move for MOVES steps and then rest."""

    def __init__(self, count: int) -> None:
        self.actions = np.zeros((count, STEPS, 1), np.float32)
        self.actions[:, :MOVES] = 1.0
        self.videos = [
            Video(f"expert-{n}", sliding_square(n, actions)) for n, actions in enumerate(self.actions)
        ]

    def __len__(self) -> int:
        return len(self.videos)

    def __getitem__(self, index: int) -> Video:
        return self.videos[index]

    def sample(self, count: int, rng: np.random.Generator) -> FrameBatch:
        return np.stack([video.frames for video in self.videos[:count]])


class CountingReward:
    """Rewards a video with its number."""

    reads_environment_reward = False
    keeps_learning = False
    reference_count = 1
    version = 0

    def state(self) -> Arrays:
        return {}

    def load_state(self, arrays: Arrays) -> None:
        pass

    def label(self, video: Video, references: Sequence[Video]) -> np.ndarray:
        return np.full(len(video.frames) - 1, float(video.name.removeprefix("expert-")), np.float32)

    def align(self, expert: VideoSource, random: VideoSource) -> Iterator[Metrics]:
        raise NotImplementedError

    def update(self, expert: VideoSource, agent: VideoSource) -> Metrics:
        raise NotImplementedError


def make_demonstrations(config: DemonstrationConfig, count: int = 6) -> Demonstrations:
    replay = ReplayBuffer(count * (STEPS + 1), SIZE, 1, stack=2, n_step=1, shift=0)
    inverse_dynamics = InverseDynamics("strided", SIZE, 2, 1, 1, seed=1, hidden_dim=64)
    return Demonstrations(config, Videos(count), replay, inverse_dynamics, SIZE, 1)


def agent_steps() -> ReplayBuffer:
    """Random slides of the same square."""
    replay = ReplayBuffer(2000, SIZE, 1, stack=2, n_step=1, shift=0)
    rng = np.random.default_rng(0)
    for number in range(60):
        actions = rng.choice([-1.0, 0.0, 1.0], size=(STEPS, 1)).astype(np.float32)
        frames = sliding_square(100 + number, actions)
        replay.add(Episode(frames, actions, Video("agent", frames), False), np.zeros(STEPS, np.float32))
    return replay


def infer_all(demonstrations: Demonstrations, rng: np.random.Generator) -> None:
    for index in range(len(demonstrations)):
        demonstrations.infer(index, CountingReward(), rng)


def test_actions_and_rewards_of_the_videos_are_inferred() -> None:
    demonstrations, replay, rng = make_demonstrations(CONFIG), agent_steps(), np.random.default_rng(0)
    for _ in range(100):
        demonstrations.learn_inverse_dynamics(replay, 0, rng, 2e-3)
    infer_all(demonstrations, rng)
    everything = demonstrations.replay.sample(6 * STEPS, rng, transitions=np.arange(6 * STEPS))
    shown = everything.action.numpy().reshape(6, STEPS)
    assert np.abs(shown[:, :MOVES] - 1).mean() < 0.3
    assert np.abs(shown[:, MOVES:]).mean() < 0.3
    np.testing.assert_array_equal(everything.reward.numpy().reshape(6, STEPS)[:, 0], np.arange(6))


@pytest.mark.parametrize("fraction", [0.75, 1.0, 0.0])
def test_transitions_are_drawn_by_movement(fraction: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inferred_demonstrations, "MOVING_FRACTION", fraction)
    monkeypatch.setattr(inferred_demonstrations, "HISTORY_DROPOUT", 0.0)
    demonstrations = make_demonstrations(CONFIG)
    batch = demonstrations.sample(64, np.random.default_rng(0))
    moves = (batch.next_observation[:, 3:] != batch.observation[:, 3:]).flatten(1).any(dim=1)
    assert float(moves.float().mean()) == fraction


def test_videos_without_movement_can_be_drawn_from() -> None:
    replay = ReplayBuffer(STEPS + 1, SIZE, 1, stack=2, n_step=1, shift=0)
    videos = Videos(1)
    videos.videos = [Video("expert-0", np.zeros((STEPS + 1, SIZE, SIZE, 3), np.uint8))]
    inverse_dynamics = InverseDynamics("strided", SIZE, 2, 1, 1, seed=1, hidden_dim=16)
    demonstrations = Demonstrations(CONFIG, videos, replay, inverse_dynamics, SIZE, 1)
    assert len(demonstrations.sample(8, np.random.default_rng(0)).reward) == 8


def test_a_mixed_batch_says_which_rows_are_demonstrated() -> None:
    demonstrations, rng = make_demonstrations(replace(CONFIG, fraction=0.25)), np.random.default_rng(0)
    infer_all(demonstrations, rng)
    batch = demonstrations.mixed(agent_steps(), 16, rng)
    assert batch.demonstrated is not None
    assert batch.demonstrated.tolist() == [False] * 12 + [True] * 4
    assert (batch.reward[:12] == 0).all()


def test_pictures_are_not_saved_twice() -> None:
    """They are the demo set's; a checkpoint holds what was inferred."""
    demonstrations, rng = make_demonstrations(CONFIG), np.random.default_rng(0)
    infer_all(demonstrations, rng)
    state = demonstrations.state()
    assert not any("frames" in name for name in state)
    restored = make_demonstrations(CONFIG)
    restored.load_state({name: array.copy() for name, array in state.items()})
    one, other = (d.sample(16, np.random.default_rng(3)) for d in (demonstrations, restored))
    np.testing.assert_array_equal(one.action, other.action)
    np.testing.assert_array_equal(one.reward, other.reward)
    np.testing.assert_array_equal(one.observation, other.observation)


def test_cloning_phases_come_when_they_are_due(tmp_path: Path, demos: Path) -> None:
    """60 steps of warm-up, then one phase, and another each 60 agent steps: at 120
    and 180, and no fourth."""
    config = replace(
        WITH_DEMONSTRATIONS, interactive=replace(WITH_DEMONSTRATIONS.interactive, agent_steps=300)
    )
    run = new_run(tmp_path / "run", demos, config=config)
    assert run.learn()
    counters = run.counters
    assert (counters.agent_steps, counters.cloning_phases) == (300, 3)
    assert counters.cloning_gradient_steps == 3 * (3 + 4)
    assert counters.cloning_steps == 3 * (3 + 4 + 4), "4 videos are named the actions of"
    assert counters.cloning_began_at == 180


def test_videos_can_be_experience_alone(tmp_path: Path, demos: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DrQv2, "clone", lambda *_: pytest.fail("something was cloned"))
    run = new_run(tmp_path / "run", demos, config=INFERRING)
    assert run.learn()
    shown, model = run.parts.demonstrations, run.parts.reward_model
    assert shown is not None and isinstance(model, FrameRewardModel)
    assert run.counters.cloning_phases == INFERRING.demonstrations.phases
    rows = [json.loads(line) for line in (tmp_path / "run" / "metrics.jsonl").read_text().splitlines()]
    evaluated = [row["agent_steps"] for row in rows if "evaluation/return_60" in row]
    assert evaluated == [120, 240], "no evaluation of a clone that there is not"
    batch = shown.replay.sample(60, np.random.default_rng(0), transitions=np.arange(60))
    assert (batch.action != 0).any(), "actions were inferred"
    # The videos' rewards follow the head as it learns.
    model.update(run.parts.demos.expert, run.parts.agent_videos)
    shown.relabel_all(model)
    np.testing.assert_array_equal(shown.replay.state()["rewards"][:30], model.label(shown.expert[0]))


@pytest.mark.parametrize(("policy_steps", "newest"), [(0, None), (30, 30), (10**9, 720)])
def test_inverse_dynamics_prefers_steps_of_the_policy(
    policy_steps: int, newest: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    demonstrations, replay = (
        make_demonstrations(CONFIG),
        agent_steps(),
    )
    drawn: list[np.ndarray] = []
    sample = ReplayBuffer.sample

    def watched(self: ReplayBuffer, *arguments: Any, **options: Any) -> Batch:
        drawn.append(options["transitions"])
        return sample(self, *arguments, **options)

    monkeypatch.setattr(ReplayBuffer, "sample", watched)
    demonstrations.learn_inverse_dynamics(replay, policy_steps, np.random.default_rng(0), 1e-3)
    assert drawn[0].shape == (128,)
    assert drawn[0].min() >= 0 and drawn[0].max() < len(replay)
    if newest is not None:
        assert (drawn[0][64:] >= len(replay) - newest).all()
    assert (drawn[0][:64] < len(replay) - 30).any()


def test_the_inverse_dynamics_sees_both_pictures_shifted_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    replay = ReplayBuffer(2000, SIZE, 1, stack=2, n_step=1, shift=4)
    picture = np.random.default_rng(0).integers(0, 256, (SIZE, SIZE, 3), dtype=np.uint8)
    still = np.stack([picture] * (STEPS + 1))
    nothing = np.zeros((STEPS, 1), np.float32)
    replay.add(Episode(still, nothing, Video("agent", still), False), nothing[:, 0])
    demonstrations = make_demonstrations(CONFIG)
    learned_from: list[Batch] = []
    monkeypatch.setattr(
        demonstrations.inverse_dynamics, "update", lambda batch, _: learned_from.append(batch) or {}
    )
    demonstrations.learn_inverse_dynamics(replay, 0, np.random.default_rng(0), 1e-3)
    before, after = learned_from[0].observation, learned_from[0].next_observation
    np.testing.assert_array_equal(before, after)
    assert len(before.unique(dim=0)) > 5, "each pair has a shift of its own"


def test_a_learning_rate_rises_and_falls_in_every_phase() -> None:
    fractions = [one_cycle(done, 100) for done in range(100)]
    highest = int(np.argmax(fractions))
    assert 3 <= highest <= 6
    assert fractions[highest] > 0.99
    assert fractions[0] < 0.25
    assert 0 < fractions[-1] < 0.001
    assert (np.diff(fractions[: highest + 1]) > 0).all()
    assert (np.diff(fractions[highest:]) < 0).all()
    assert 0 < one_cycle(0, 1) <= 1  # a phase of a single step


def test_where_time_is_further_on_it_moves_the_learning_rate() -> None:
    assert one_cycle(10, 1000, 0.5) == pytest.approx(one_cycle(499, 999))
    assert one_cycle(700, 1000, 0.5) == one_cycle(700, 1000)


def test_a_cloning_phase_ends_with_its_share_of_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each step takes a second: a third of 30 for the inverse dynamics, 6 videos, the rest for the clone."""

    class OneSecond:
        def lap(self) -> float:
            return 1.0

    monkeypatch.setattr("bootifol.training.cloning.Stopwatch", OneSecond)
    config = replace(CONFIG, inverse_dynamics_updates=500, cloning_updates=500)
    demonstrations, rng = make_demonstrations(config), np.random.default_rng(0)
    agent = DrQv2(DrQv2Config(encoder="strided", hidden_dim=16, batch_size=8), SIZE, 2, 1, seed=0)
    counters = Counters(agent_steps=1920, cloning_seconds=7.0)
    budget = Budget(agent_steps=1000, seconds=100.0, cloning_fraction=0.3)
    phase = cloning_phase(
        agent, demonstrations, agent_steps(), CountingReward(), rng, budget, counters, log_every=100
    )
    steps = [*phase]
    learned = [
        sum(name in step.metrics[0] for step in steps)
        for name in ("inverse_dynamics/loss", "agent/cloning_loss")
    ]
    assert learned == [11, 31 - 11 - 6]
    assert counters.cloning_steps == steps_of_a_phase(demonstrations)
    assert counters.cloning_gradient_steps == sum(learned)
    assert not cloning_in_progress(demonstrations, counters)


def test_warm_up_actions_are_held(tmp_path: Path, demos: Path) -> None:
    config = replace(
        WITH_DEMONSTRATIONS, agent=replace(WITH_DEMONSTRATIONS.agent, warm_up_steps=240, warm_up_hold=5)
    )
    run = new_run(tmp_path / "run", demos, config=config)
    run.interactive.play_episode()
    transitions = np.arange(len(run.parts.replay))
    actions = run.parts.replay.sample(
        len(transitions), np.random.default_rng(0), transitions=transitions
    ).action.numpy()
    changes = np.flatnonzero((actions[1:] != actions[:-1]).any(axis=1)) + 1
    held = np.diff([0, *changes])
    assert held.max() <= 5 and len(set(held)) > 2


@pytest.mark.parametrize(
    ("field", "value"),
    [("fraction", 1.0), ("cloning_updates", -1)],
)
def test_mistakes_are_sentences(field: str, value: float) -> None:
    with pytest.raises(BootifolError, match=field):
        DemonstrationConfig(**{field: value})  # type: ignore[arg-type]


def test_a_cloning_phase_that_time_would_cut_off_does_not_begin() -> None:
    demonstrations = make_demonstrations(replace(CONFIG, phases=2, repeat_every=60))
    counters = Counters(
        agent_steps=120,
        cloning_phases=1,
        cloning_began_at=60,
        cloning_seconds=30.0,
        interactive_seconds=10.0,
        cloning_steps=steps_of_a_phase(demonstrations),
    )
    assert cloning_due(demonstrations, counters, Budget(agent_steps=1000))
    assert cloning_due(demonstrations, counters, Budget(agent_steps=1000, seconds=70.0))
    assert not cloning_due(demonstrations, counters, Budget(agent_steps=1000, seconds=69.0))
    counters.cloning_began_at = 61
    assert not cloning_due(demonstrations, counters, Budget(agent_steps=1000))
    counters.cloning_began_at, counters.cloning_phases = 60, 2
    assert cloning_due(demonstrations, counters, Budget(agent_steps=1000, seconds=41.0))  # it was begun
