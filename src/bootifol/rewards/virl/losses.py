"""The losses of ViRL: pure functions of tensors, one equation each.

Total (paper, Eq. 4): `L = lambda_1 L_SNS + lambda_2 L_SNI + lambda_3 L_RAES + lambda_4 L_VAEI`. L_SNS and L_SNI are one
formula, on encodings of sequences and of frames; so are L_RAES and L_VAEI, on pictures decoded from the two. Every
loss is a mean, so its size does not depend on the batch. All sums run in float32.
"""

from __future__ import annotations

import torch


def siamese_loss(
    anchor: torch.Tensor, positive: torch.Tensor, negative: torch.Tensor, margin: float
) -> torch.Tensor:
    """L_SNX, Eq. (3): `d(f_i, f_p) + max(rho - d(f_i, f_n), 0)`, averaged over the anchors.

    With h, the encodings of sequences, it is L_SNS; with e, those of frames (averaged over time, Eq. 4), L_SNI.

    `d` is `||a - b||`. In the release it is the mean square over the dimensions, which near zero hardly has a gradient,
    and the margin is that of the batch's mean distance, here of each anchor.

    Args:
        anchor: f_i `[..., D]`.
        positive: f_p `[..., D]`.
        negative: f_n `[..., D]`.
        margin: rho.
    """
    near, far = (_distance(anchor, other) for other in (positive, negative))
    return (near + (margin - far).clamp(min=0)).mean()


def reconstruction_loss(pictures: torch.Tensor, decoded: torch.Tensor) -> torch.Tensor:
    """L_VAEI and L_RAES: `||o - decoded||^2`, averaged over frames, channels and pixels.

    The picture is decoded from its own encoding e_t (L_VAEI), or from what the sequence decoder makes of h_T, the
    encoding of its whole video (L_RAES).

    Differs from the paper in that L_VAEI is that of a plain autoencoder, as in the public release: a variational one
    (Eq. 1) would add noise to the encodings and pull them to a normal distribution.

    Args:
        pictures: o `[N, 3, H, W]` in [0, 1].
        decoded: `[N, 3, H, W]`.
    """
    return (decoded.float() - pictures.float()).square().mean()


def _distance(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """d of vectors `[..., D]`: float32 `[...]`. The gradient of a Euclidean distance of 0 is 0."""
    norm: torch.Tensor = torch.linalg.vector_norm(a.float() - b.float(), dim=-1)
    return norm
