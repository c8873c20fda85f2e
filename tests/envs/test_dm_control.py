import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fingerprints import fingerprints

from bootifol.envs.pictures import PictureConfig
from bootifol.tasks import TASKS, make_environment

pytestmark = pytest.mark.usefixtures("requires_rendering")


def test_a_seed_gives_the_same_episode_to_the_bit_in_any_process() -> None:
    script = Path(__file__).with_name("fingerprints.py")
    other = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    # Environments that nobody closed leave without a complaint.
    assert (other.returncode, other.stderr) == (0, "")
    here = fingerprints(another_episode_first=False)
    assert len(set(here)) == 2 * len(TASKS)  # two seeds each
    assert other.stdout.splitlines() == here


def test_different_seeds_give_different_starts() -> None:
    environment = make_environment("reacher_hard", PictureConfig(24, 24), 1)
    starts = {environment.reset(seed=seed)[1]["frame"].tobytes() for seed in range(4)}
    environment.close()
    assert len(starts) == 4


def test_an_action_moves_the_arm_and_none_leaves_it_alone() -> None:
    environment = make_environment("reacher_hard", PictureConfig(24, 24), 5)
    physics = environment.simulator.physics  # type: ignore[attr-defined]
    environment.reset(seed=0)
    start = physics.data.qpos.copy()
    environment.step(np.zeros(2, np.float32))
    np.testing.assert_array_equal(physics.data.qpos, start)
    environment.step(np.array([1.0, 0.0], np.float32))
    assert physics.data.qpos[0] > start[0]
    environment.close()


def test_the_time_limit_is_ours_even_beyond_the_suites() -> None:
    environment = make_environment("reacher_hard", PictureConfig(8, 8), 10)
    environment.reset(seed=0)
    # The suite's reacher stops after 1000 of its steps.
    simulator = environment.simulator
    simulator.environment._step_count = 1000  # type: ignore[attr-defined]
    where = simulator.physics.data.geom("target").xpos.copy()  # type: ignore[attr-defined]
    for _ in range(9):
        *_, terminated, truncated, _ = environment.step(np.ones(2, np.float32))
        assert not (terminated or truncated)
    np.testing.assert_array_equal(simulator.physics.data.geom("target").xpos, where)  # type: ignore[attr-defined]
    environment.close()


def test_a_whole_turn_leads_hoppers_state_back_to_where_it_was() -> None:
    environment = make_environment("hopper_stand", PictureConfig(8, 8, stack=1), 5)
    environment.reset(seed=0)
    simulator = environment.simulator
    physics = simulator.physics  # type: ignore[attr-defined]
    states = []
    for angle in (0.5, 0.5 + 2 * np.pi, 1.0):
        physics.named.data.qpos["rooty"] = angle
        physics.forward()
        states.append(simulator.state())  # type: ignore[attr-defined]
    environment.close()
    np.testing.assert_allclose(states[1], states[0], atol=1e-6)
    np.testing.assert_allclose(states[2][-2:], [np.cos(1.0), np.sin(1.0)], rtol=1e-6)
    assert len(states[0]) == 16
