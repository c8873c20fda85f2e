import numpy as np
import pytest
import torch
from benchmarks.plain import alignment as plain

from bootifol.networks.color import normalized_lab

CENTER = np.array([50.0, 6.025, -6.69])
HALF_RANGE = np.array([50.0, 92.208, 101.17])


@pytest.mark.parametrize(
    ("rgb", "expected_lab"),
    [
        ((0, 0, 0), (0.0, 0.0, 0.0)),
        ((255, 255, 255), (100.0, 0.0, 0.0)),
        ((255, 0, 0), (53.2408, 80.0925, 67.2032)),
        ((0, 255, 0), (87.7347, -86.1827, 83.1793)),
        ((0, 0, 255), (32.2970, 79.1875, -107.8602)),
        ((128, 128, 128), (53.5850, 0.0, 0.0)),
    ],
)
def test_known_colors(rgb: tuple[int, int, int], expected_lab: tuple[float, float, float]) -> None:
    picture = np.full((1, 2, 2, 3), rgb, dtype=np.uint8)
    lab = normalized_lab(picture).permute(0, 2, 3, 1)[0, 0, 0].double().numpy() * HALF_RANGE + CENTER
    np.testing.assert_allclose(lab, expected_lab, atol=0.01)


def test_agrees_with_the_definitions_in_float64() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (4, 32, 32, 3), dtype=np.uint8)
    rgb[0] //= 16  # dark colors, where the cube root is steep
    expected = np.stack([plain.lab(frame) for frame in rgb])
    np.testing.assert_allclose(normalized_lab(rgb).numpy(), expected, atol=1.5e-4)


def test_layout_type_and_range() -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (3, 8, 8, 3), dtype=np.uint8)[:, ::2]
    lab = normalized_lab(rgb, torch.bfloat16)
    assert lab.dtype == torch.bfloat16
    assert lab.shape == (3, 3, 4, 8)
    assert lab.is_contiguous(memory_format=torch.channels_last)
    assert lab.abs().max() <= 1.01
    assert torch.equal(lab, normalized_lab(np.ascontiguousarray(rgb)).to(torch.bfloat16))
