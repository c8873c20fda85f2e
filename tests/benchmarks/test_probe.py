"""The probe reads what is there, and nothing out of noise."""

from __future__ import annotations

import pytest
import torch
from benchmarks.probe import read, watched, with_fields

from bootifol.errors import BootifolError
from bootifol.presets import preset
from bootifol.rewards.bootifol.frames.config import FrameConfig


def test_it_reads_what_states_tell_and_nothing_else() -> None:
    random = torch.Generator().manual_seed(0)
    states = torch.randn(2000, 6, generator=random)
    told = states[:, :1] - 2 * states[:, 1:2]
    unrelated = torch.randn(2000, 1, generator=random)
    r2, error = read(states, 0.1 * torch.cat([told, unrelated], 1), epochs=15)
    assert r2[0] > 0.95
    assert r2[1] < 0.1
    assert error[0] < 0.05 < error[1]


def test_fields_of_the_eyes_are_numbers() -> None:
    changed = with_fields(FrameConfig(), ["width=32", "temperature=0.1"])
    assert (changed.width, changed.temperature) == (32, 0.1)
    for wrong in ("width=wide", "breadth=32", "precision=bf16", "width"):
        with pytest.raises(BootifolError, match=f"--field {wrong}"):
            with_fields(FrameConfig(), [wrong])


@pytest.mark.parametrize(("task", "named"), [("reacher_hard", "to_target[0]"), ("plate_slide", "object[0]")])
def test_frames_go_with_what_the_simulator_shows(task: str, named: str) -> None:
    frames, truth, names = watched(task, 30, preset("frames").pictures)
    assert frames.shape == (30, 64, 64, 3)
    assert truth.shape == (30, len(names))
    assert named in names
    assert truth[:, names.index(named)].std() > 0


def test_a_task_without_an_observation_is_a_sentence() -> None:
    with pytest.raises(BootifolError, match="DeepMind Control and Meta-World"):
        watched("drawn_reach", 5, preset("frames").pictures)
