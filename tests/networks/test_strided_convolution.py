import pytest
import torch
import torch.nn.functional as F

from bootifol.networks.strided_convolution import (
    StridedConvolution,
    StridedTransposedConvolution,
    small_size,
)

SIZES = [5, 6, 13, 14, 20, 30]
"""Large sides that take each of the ways: one pixel, film strips, the library; odd and even."""


@pytest.mark.parametrize("count", [3, 8, 17])
@pytest.mark.parametrize("size", SIZES)
def test_convolution_and_gradients_agree_with_pytorch(size: int, count: int) -> None:
    torch.manual_seed(size + count)
    layer = StridedConvolution(3, 4).double()
    pictures = torch.randn(count, 3, size, size, dtype=torch.double).requires_grad_()
    expected = F.conv2d(pictures, layer.weight, None, 2)
    _assert_same(layer(pictures), expected, (pictures, layer.weight))


@pytest.mark.parametrize("count", [3, 8, 17])
@pytest.mark.parametrize("size", SIZES)
def test_transposed_convolution_and_gradients_agree_with_pytorch(size: int, count: int) -> None:
    torch.manual_seed(size + count)
    small = small_size(size)
    layer = StridedTransposedConvolution(4, 3, size, bias=True).double()
    torch.nn.init.normal_(layer.bias)
    pictures = torch.randn(count, 4, small, small, dtype=torch.double).requires_grad_()
    padding = size - (2 * small + 3)
    expected = F.conv_transpose2d(pictures, layer.weight, layer.bias, 2, output_padding=padding)
    _assert_same(layer(pictures), expected, (pictures, layer.weight, layer.bias))


def test_needs_no_gradient_of_the_pictures() -> None:
    layer = StridedConvolution(3, 4)
    layer(torch.randn(2, 3, 13, 13)).sum().backward()
    assert layer.weight.grad is not None


def _assert_same(actual: torch.Tensor, expected: torch.Tensor, inputs: tuple[torch.Tensor, ...]) -> None:
    torch.testing.assert_close(actual, expected)
    gradient = torch.randn_like(expected)
    for one, two in zip(
        torch.autograd.grad(actual, inputs, gradient),
        torch.autograd.grad(expected, inputs, gradient),
        strict=True,
    ):
        torch.testing.assert_close(one, two)
