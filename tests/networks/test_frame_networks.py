import pytest
import torch
from benchmarks.plain import alignment as plain
from torch import nn

from bootifol.errors import BootifolError
from bootifol.networks.frame_decoder import FrameDecoder
from bootifol.networks.frame_encoders import FrameEncoder, picture_sizes


def test_picture_sizes_are_those_of_the_paper() -> None:
    assert picture_sizes(64) == [64, 30, 13, 5, 1]
    assert picture_sizes(32) == [32, 14, 5, 1]


@pytest.mark.parametrize("size", [8, 48, 84, 128])
def test_other_sizes_are_refused_with_a_sentence(size: int) -> None:
    with pytest.raises(BootifolError, match=f"cannot read {size}x{size} videos.*64x64"):
        FrameEncoder(size)


def test_parameter_counts_are_those_of_the_tables() -> None:
    # By hand from the tables: 25 * in * out per 5x5 layer, in * out per 1x1 layer, a scale and a shift per
    # BatchNorm channel, a bias where there is no BatchNorm.
    widths = [64, 128, 256, 512]
    shared = 25 * (64 * 128 + 128 * 256 + 256 * 512) + 512 * 512 + 512 * 64 + 64 + 2 * (sum(widths) + 512)
    encoder = FrameEncoder(64)
    assert _parameters(encoder.lightness) == 25 * 1 * 64 + shared
    assert _parameters(encoder.color) == 25 * 2 * 64 + shared
    decoder = 128 * 512 + 512 + 512 * 512 + 2 * 512
    decoder += 25 * (512 * 256 + 256 * 128 + 128 * 64 + 64 * 3) + 2 * (256 + 128 + 64) + 3
    assert _parameters(FrameDecoder(64)) == decoder


@pytest.mark.parametrize(("size", "layers"), [(64, 4), (32, 3)])
def test_encoder_agrees_with_the_plain_table(size: int, layers: int) -> None:
    torch.manual_seed(0)
    encoder = FrameEncoder(size, width_divisor=16).double()
    pictures = torch.randn(5, 3, size, size, dtype=torch.double).contiguous(memory_format=torch.channels_last)
    for training in (False, True):  # evaluation first: running statistics are new in both
        encoder.train(training)
        states = encoder(pictures[:, :1], pictures[:, 1:])
        assert states.shape == (5, 128)
        for view, own, columns in (
            (pictures[:, :1], encoder.lightness, slice(0, 64)),
            (pictures[:, 1:], encoder.color, slice(64, 128)),
        ):
            table = _with_weights_of(own, plain.view_encoder(view.shape[1], 16, layers)).train(training)
            torch.testing.assert_close(states[:, columns], table(view).flatten(1))


def test_decoder_agrees_with_the_plain_table() -> None:
    torch.manual_seed(0)
    decoder = FrameDecoder(64, width_divisor=16).double()
    nn.init.normal_(decoder.strided[-1].bias)
    states = torch.randn(5, 128, dtype=torch.double)
    for training in (False, True):  # evaluation first: running statistics are new in both
        table = _with_weights_of(decoder, plain.decoder(16)).train(training)
        pictures = decoder.train(training)(states)
        assert pictures.shape == (5, 3, 64, 64)
        torch.testing.assert_close(pictures, table(states[:, :, None, None]))


def test_decoder_of_small_videos() -> None:
    assert FrameDecoder(32, width_divisor=16)(torch.randn(2, 128)).shape == (2, 3, 32, 32)


def _parameters(module: nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


def _with_weights_of(source: nn.Module, target: nn.Sequential) -> nn.Sequential:
    """Copies parameters, in float64, in the order of the layers."""
    target.double()
    with torch.no_grad():
        for own, other in zip(target.parameters(), source.parameters(), strict=True):
            own.copy_(other.reshape(own.shape))
    return target
