"""The 5x5 stride-2 convolution of the frame encoders and its transpose, quick also on small pictures.

A CPU's convolution works picture by picture, and is slow where a picture has few pixels left. So, by what comes out
of the convolution (or goes into the transposed one):

    1 pixel           one matrix product over the batch
    up to 8x8 pixels  pictures are laid side by side on film strips, each padded to an even width, and convolved
                      together; columns that mix two pictures are thrown away

                      | picture 0 . | picture 1 . | picture 2 . | ...     a strip: [H, STRIP * padded width]
                      | y 0 0 0 - - | y 1 1 1 - - | y 2 2 2 - - | ...     what is kept (y) and not (-)

    more              the library's convolution as it is

The results are the same up to rounding. Pictures are `[N, C, H, W]`, channels last in memory; the weight
`[C_small, C_large, 5, 5]` is that of the convolution from the large picture to the small one, in both directions.
"""

from __future__ import annotations

from typing import Any, cast

import torch
import torch.nn.functional as F
from torch import nn

KERNEL = 5
STRIDE = 2

STRIP = 8
"""Pictures side by side on a film strip."""

STRIP_BELOW = 9
"""Small pictures narrower than this many pixels are laid on film strips."""


def small_size(large: int) -> int:
    """The side of the picture after the convolution."""
    return (large - KERNEL) // STRIDE + 1


class StridedConvolution(nn.Module):
    """5x5 convolution of stride 2 without bias: `[N, C, H, H]` to `[N, C', h, h]`, `h = (H - 5) // 2 + 1`."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        initial = nn.Conv2d(channels_in, channels_out, KERNEL, STRIDE, bias=False).weight
        self.weight = nn.Parameter(initial.detach().contiguous(memory_format=torch.channels_last))

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        weight = self.weight.to(pictures.dtype)
        size = small_size(pictures.shape[-1])
        if size == 1:
            pixels = pictures[:, :, :KERNEL, :KERNEL].permute(0, 2, 3, 1).flatten(1)
            return (pixels @ _as_matrix(weight).T)[:, :, None, None]
        if size < STRIP_BELOW:
            return cast(torch.Tensor, _OnStrips.apply(pictures, weight))  # type: ignore[no-untyped-call]
        return F.conv2d(pictures, weight, None, STRIDE)


class StridedTransposedConvolution(nn.Module):
    """Transposed 5x5 convolution of stride 2: `[N, C, h, h]` to `[N, C', H, H]`.

    Args:
        channels_in: C.
        channels_out: C'.
        size_out: H; its last row and column are zero where the convolution would not have read them.
        bias: adds one number per channel.
    """

    def __init__(self, channels_in: int, channels_out: int, size_out: int, bias: bool = False) -> None:
        super().__init__()
        initial = nn.ConvTranspose2d(channels_in, channels_out, KERNEL, STRIDE, bias=False).weight
        self.weight = nn.Parameter(initial.detach().contiguous(memory_format=torch.channels_last))
        self.bias = nn.Parameter(torch.zeros(channels_out)) if bias else None
        self.size_out = size_out

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        weight = self.weight.to(pictures.dtype)
        bias = None if self.bias is None else self.bias.to(pictures.dtype)
        if pictures.shape[-1] >= STRIP_BELOW:
            missing = self.size_out - ((pictures.shape[-1] - 1) * STRIDE + KERNEL)
            return F.conv_transpose2d(pictures, weight, bias, STRIDE, output_padding=missing)
        grown = self._grow_small(pictures, weight)
        return grown if bias is None else grown + bias[:, None, None]

    def _grow_small(self, pictures: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
        size = pictures.shape[-1]
        missing = self.size_out - ((size - 1) * STRIDE + KERNEL)
        if size == 1:
            pixels = pictures.flatten(1) @ _as_matrix(weight)
            large = pixels.reshape(-1, KERNEL, KERNEL, weight.shape[1]).permute(0, 3, 1, 2)
            return F.pad(large, (0, missing, 0, missing)) if missing else large
        grown = _TransposedOnStrips.apply(pictures, weight, self.size_out)  # type: ignore[no-untyped-call]
        return cast(torch.Tensor, grown)


class _OnStrips(torch.autograd.Function):
    """The convolution on film strips."""

    @staticmethod
    def forward(ctx: Any, pictures: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
        count, _, large, _ = pictures.shape
        strips = _to_strips(pictures, large, _spacing(large))
        ctx.save_for_backward(strips, weight)
        ctx.shape = (count, large)
        return _from_strips(F.conv2d(strips, weight, None, STRIDE), count, _spacing(large) // STRIDE)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor | None, torch.Tensor]:
        strips, weight = ctx.saved_tensors
        count, large = ctx.shape
        small_strips = _to_strips(gradients[0], small_size(large), _spacing(large) // STRIDE)
        wanted = ctx.needs_input_grad[0]
        of_strips, of_weight = _gradients(small_strips, strips, weight, wanted, True)
        of_pictures = _from_strips(of_strips, count, _spacing(large)) if wanted else None
        return of_pictures, of_weight


class _TransposedOnStrips(torch.autograd.Function):
    """The transposed convolution on film strips: the gradient of the convolution to its input, used forward."""

    @staticmethod
    def forward(ctx: Any, pictures: torch.Tensor, weight: torch.Tensor, large: int) -> torch.Tensor:
        count, _, small, _ = pictures.shape
        strips = _to_strips(pictures, small, _spacing(large) // STRIDE)
        ctx.save_for_backward(strips, weight)
        ctx.shape = (count, large)
        shape = (strips.shape[0], weight.shape[1], large, (STRIP - 1) * _spacing(large) + large)
        like = torch.empty(shape, dtype=strips.dtype, device=strips.device, memory_format=torch.channels_last)
        large_strips, _ = _gradients(strips, like, weight, True, False)
        return _from_strips(large_strips, count, _spacing(large))

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, None]:
        strips, weight = ctx.saved_tensors
        count, large = ctx.shape
        large_strips = _to_strips(gradients[0], large, _spacing(large))
        _, of_weight = _gradients(strips, large_strips, weight, False, True)
        of_strips = F.conv2d(large_strips, weight, None, STRIDE)
        return _from_strips(of_strips, count, _spacing(large) // STRIDE), of_weight, None


def _spacing(large: int) -> int:
    """Columns from one large picture on a strip to the next: even, and enough for the kernel not to reach over."""
    return STRIDE * ((large + STRIDE - 1) // STRIDE)


def _to_strips(pictures: torch.Tensor, size: int, spacing: int) -> torch.Tensor:
    """Pictures `[N, C, size, size]` to strips `[ceil(N / STRIP), C, size, (STRIP - 1) * spacing + size]`."""
    count, channels = pictures.shape[:2]
    strips = pictures.new_zeros(-(-count // STRIP), size, (STRIP - 1) * spacing + size, channels)
    target, source = _on_strips(strips, spacing), pictures.permute(0, 2, 3, 1)
    whole = count // STRIP
    source_of_whole = source[: whole * STRIP].reshape(whole, STRIP, size, size, channels)
    target[:whole] = source_of_whole.transpose(1, 2)
    if whole < len(strips):
        target[whole, :, : count - whole * STRIP] = source[whole * STRIP :].transpose(0, 1)
    return strips.permute(0, 3, 1, 2)


def _from_strips(strips: torch.Tensor, count: int, spacing: int) -> torch.Tensor:
    """The inverse of `_to_strips`, for `count` pictures."""
    strips = strips.permute(0, 2, 3, 1)
    if not strips.is_contiguous():
        strips = strips.contiguous()
    return _on_strips(strips, spacing).transpose(1, 2).flatten(0, 1)[:count].permute(0, 3, 1, 2)


def _on_strips(strips: torch.Tensor, spacing: int) -> torch.Tensor:
    """A view `[strips, H, STRIP, H, C]` of the pictures on contiguous strips `[strips, H, width, C]`."""
    count, size, width, channels = strips.shape
    row = width * channels
    return strips.as_strided(
        (count, size, STRIP, size, channels), (size * row, row, spacing * channels, channels, 1)
    )


def _gradients(
    small: torch.Tensor, large: torch.Tensor, weight: torch.Tensor, to_large: bool, to_weight: bool
) -> tuple[torch.Tensor, torch.Tensor]:
    """Gradients of the convolution to its input (the transposed convolution of `small`) and to its weight."""
    of_large, of_weight, _ = torch.ops.aten.convolution_backward(
        small,
        large,
        weight,
        None,
        [STRIDE] * 2,
        [0, 0],
        [1, 1],
        False,
        [0, 0],
        1,
        [to_large, to_weight, False],
    )
    return of_large, of_weight


def _as_matrix(weight: torch.Tensor) -> torch.Tensor:
    """`[C_small, 25 * C_large]`, in the order of channels-last pixels (no copy: the weight is stored so)."""
    return weight.permute(0, 2, 3, 1).flatten(1)
