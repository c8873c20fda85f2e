import numpy as np
import pytest
import torch
from benchmarks.plain import alignment as plain

from bootifol.networks.color import lab_views

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
    lab = torch.cat(lab_views(picture), 1).permute(0, 2, 3, 1)[0, 0, 0].double().numpy() * HALF_RANGE + CENTER
    np.testing.assert_allclose(lab, expected_lab, atol=0.01)


def test_agrees_with_the_definitions_in_float64() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (4, 32, 32, 3), dtype=np.uint8)
    rgb[0] //= 16  # dark colors, where the cube root is steep
    expected = np.stack([plain.lab(frame) for frame in rgb])
    np.testing.assert_allclose(torch.cat(lab_views(rgb), 1).numpy(), expected, atol=1.5e-4)


def test_layout_type_and_range() -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (3, 8, 8, 3), dtype=np.uint8)[:, ::2]
    lightness, color = lab_views(rgb, torch.bfloat16)
    assert lightness.shape == (3, 1, 4, 8)
    assert color.shape == (3, 2, 4, 8)
    for view, contiguous in zip((lightness, color), lab_views(np.ascontiguousarray(rgb)), strict=True):
        assert view.dtype == torch.bfloat16
        assert view.is_contiguous(memory_format=torch.channels_last)
        assert view.abs().max() <= 1.01
        assert torch.equal(view, contiguous.to(torch.bfloat16))


def test_any_number_of_threads_gives_the_same() -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (3, 8, 7, 3), dtype=np.uint8)
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        one = torch.cat(lab_views(rgb), 1)
        torch.set_num_threads(3)
        assert torch.equal(torch.cat(lab_views(rgb), 1), one)
    finally:
        torch.set_num_threads(before)
