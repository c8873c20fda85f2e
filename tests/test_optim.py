from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import nn

from bootifol.errors import BootifolError
from bootifol.optim import load_module_state, module_state
from bootifol.types import Arrays


def trained(seed: int, steps: int) -> tuple[nn.Sequential, dict[str, torch.optim.Adam]]:
    """Networks that end in a layer which only one of two optimizers trains."""
    torch.manual_seed(seed)
    layers = nn.Sequential(nn.Conv2d(3, 4, 3), nn.BatchNorm2d(4), nn.Flatten(), nn.Linear(16, 2))
    layers.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizers = {
        "all": torch.optim.Adam(layers.parameters(), fused=True),
        "last": torch.optim.Adam(layers[3].parameters(), fused=True),
    }
    for _ in range(steps):
        for optimizer in optimizers.values():
            optimizer.zero_grad()
            layers(torch.rand(5, 3, 4, 4)).square().sum().backward()
            optimizer.step()
    return layers, optimizers


def state_of(learner: tuple[nn.Sequential, dict[str, torch.optim.Adam]]) -> Arrays:
    return module_state(*learner, prefix="here/")


@pytest.mark.parametrize("steps", [0, 2])
def test_what_was_stored_is_there_again_under_its_names_and_as_it_lay_in_memory(steps: int) -> None:
    stored, learner = state_of(trained(0, steps)), trained(1, 1)
    assert all(name.startswith("here/") and array.flags.c_contiguous for name, array in stored.items())
    assert ("here/all/exp_avg/0.weight" in stored) == ("here/last/step/3.bias" in stored) == (steps > 0)
    assert "here/last/step/0.weight" not in stored
    load_module_state(*learner, stored, "learner", prefix="here/")
    found = state_of(learner)
    assert found.keys() == stored.keys()
    for name, array in stored.items():
        np.testing.assert_array_equal(found[name], array, err_msg=name)
    for optimizer in learner[1].values():
        for parameter, kept in optimizer.state.items():
            assert kept["step"].shape == ()
            assert kept["exp_avg"].stride() == kept["exp_avg_sq"].stride() == parameter.stride()


@pytest.mark.parametrize(
    "name", ["0.weight", "1.running_mean", "all/exp_avg/0.weight", "last/exp_avg_sq/3.bias"]
)
@pytest.mark.parametrize("found", ["is missing", r"has shape \[7\]"])
def test_what_does_not_fit_is_refused_with_a_sentence_and_changes_nothing(name: str, found: str) -> None:
    stored, learner = state_of(trained(0, 1)), trained(1, 1)
    before = state_of(learner)
    del stored[f"here/{name}"]
    if "shape" in found:
        stored[f"here/{name}"] = np.zeros(7, np.float32)
    with pytest.raises(
        BootifolError, match=f"the stored learner does not fit its configuration: here/{name} {found}"
    ):
        load_module_state(*learner, stored, "learner", prefix="here/")
    for kept, array in state_of(learner).items():
        np.testing.assert_array_equal(array, before[kept], err_msg=kept)
