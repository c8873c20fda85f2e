"""The paper's losses, colors and networks written straight from its equations and tables, in float32.

They share no code with `bootifol.rewards`, so that the tests may compare the two. Losses loop over their anchors, one
frame and one video at a time; `bootifol.py` beside it has them in batches.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

TEMPERATURE = 0.07
MARGIN = 1.0
WINDOW = 2
PREDICTED = 2
LEAK = 0.2


def lab(frame: NDArray[np.uint8]) -> NDArray[np.float64]:
    """One RGB picture `[H, W, 3]` to normalized CIE Lab `[3, H, W]`, D65, from the definitions."""
    value = frame / 255.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    red, green, blue = linear[..., 0], linear[..., 1], linear[..., 2]
    x = 0.4124564 * red + 0.3575761 * green + 0.1804375 * blue
    y = 0.2126729 * red + 0.7151522 * green + 0.0721750 * blue
    z = 0.0193339 * red + 0.1191920 * green + 0.9503041 * blue

    def f(t: NDArray[np.float64]) -> NDArray[np.float64]:
        root: NDArray[np.float64] = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
        return root

    f_x, f_y, f_z = f(x / 0.95047), f(y / 1.0000001), f(z / 1.08883)
    lightness, a, b = 116 * f_y - 16, 500 * (f_x - f_y), 200 * (f_y - f_z)
    return np.stack([(lightness - 50) / 50, (a - 6.025) / 92.208, (b + 6.69) / 101.17])


def h(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """`exp(a.b / (tau |a| |b|))` of two vectors, or of a vector and the rows of a matrix."""
    return torch.exp((a * b).sum(-1) / (TEMPERATURE * a.norm(dim=-1) * b.norm(dim=-1)))


def multiview_loss(view_1: torch.Tensor, view_2: torch.Tensor) -> torch.Tensor:
    """L_S on `[N, 64]` each: frame by frame, one view against all frames' other views, in both directions."""
    total = torch.zeros(())
    for i in range(len(view_1)):
        total = total - torch.log(h(view_1[i], view_2[i]) / h(view_1[i], view_2).sum())
        total = total - torch.log(h(view_2[i], view_1[i]) / h(view_2[i], view_1).sum())
    return total / len(view_1)


def triplet_loss(states: torch.Tensor, triplets: list[tuple[int, int, int]]) -> torch.Tensor:
    """L_triplet on the states `[T + 1, 128]` of one video, for (anchor, positive, negative) frames."""
    total = torch.zeros(())
    for anchor, positive, negative in triplets:
        near = ((states[anchor] - states[positive]) ** 2).mean()
        far = ((states[anchor] - states[negative]) ** 2).mean()
        total = total + near + torch.clamp(MARGIN - far, min=0.0)
    return total / len(triplets)


def prediction_loss(predicted: torch.Tensor, states: torch.Tensor, start: int) -> torch.Tensor:
    """L_Z on one video: predictions `[K, 128]` of the states after `start` among the states `[T + 1, 128]`."""
    total = torch.zeros(())
    for k in range(1, len(predicted) + 1):
        prediction, t = predicted[k - 1], start + k
        negatives = sum((h(prediction, states[u]) for u in range(len(states)) if u != t), torch.zeros(()))
        match = h(prediction, states[t])
        total = total - torch.log(match / (match + negatives))
    return total / len(predicted)


def sequence_loss(expert: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """L_O on the encodings `[n, 128]` of whole videos."""
    total = torch.zeros(())
    for one, two in ((expert, other), (other, expert)):
        for i in range(len(one)):
            match = h(one[i], one[(i + 1) % len(one)])
            negatives = sum((h(one[i], two[j]) for j in range(len(two))), torch.zeros(()))
            total = total - torch.log(match / (match + negatives))
    return total / (2 * len(expert))


def view_encoder(channels: int, divisor: int = 1, layers: int = 4) -> nn.Sequential:
    """Table "Encoder network" for one view; `layers` 5x5 convolutions (4 for 64x64, 3 for 32x32)."""
    widths = [channels, 64 // divisor, 128 // divisor, 256 // divisor, 512 // divisor][: layers + 1]
    modules: list[nn.Module] = []
    for i in range(layers):
        modules += [nn.Conv2d(widths[i], widths[i + 1], 5, 2, bias=False), nn.BatchNorm2d(widths[i + 1])]
        modules += [nn.LeakyReLU(LEAK)]
    modules += [nn.Conv2d(widths[-1], 512 // divisor, 1, bias=False), nn.BatchNorm2d(512 // divisor)]
    modules += [nn.LeakyReLU(LEAK), nn.Conv2d(512 // divisor, 64, 1)]
    return nn.Sequential(*modules)


def decoder(divisor: int = 1) -> nn.Sequential:
    """Table "Decoder network", for 64x64."""
    modules: list[nn.Module] = [nn.Conv2d(128, 512 // divisor, 1), nn.LeakyReLU(LEAK)]
    modules += [nn.Conv2d(512 // divisor, 512 // divisor, 1, bias=False), nn.BatchNorm2d(512 // divisor)]
    modules += [nn.LeakyReLU(LEAK)]
    for before, after, padding in ((512, 256, 0), (256, 128, 0), (128, 64, 1)):
        modules += [
            nn.ConvTranspose2d(before // divisor, after // divisor, 5, 2, output_padding=padding, bias=False),
            nn.BatchNorm2d(after // divisor),
            nn.LeakyReLU(LEAK),
        ]
    modules += [nn.ConvTranspose2d(64 // divisor, 3, 5, 2, output_padding=1)]
    return nn.Sequential(*modules)
