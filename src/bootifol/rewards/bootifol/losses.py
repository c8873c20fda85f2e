"""The five losses of BootIfOL: pure functions of tensors, one equation each.

Notation: `B` videos, `T` agent steps (`T + 1` frames), `N` frames, `n` videos per class, `D` size of a vector;
`h(a, b) = exp(cos(a, b) / tau)` is the similarity of the paper's Eq. (4). Every loss is a mean, so its size does not
depend on the batch. All sums run in float32.

Total (paper, "Sequence encoding"): `L = L_S + L_triplet + L_ae + L_Z + L_O`; the weights are in the config.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F


def multiview_loss(view_1: torch.Tensor, view_2: torch.Tensor, temperature: float) -> torch.Tensor:
    """L_S: the two views of a frame find each other among all frames of the batch.

    `L_S = -mean_i log h(a_i, b_i) / sum_j h(a_i, b_j)  -  mean_i log h(b_i, a_i) / sum_j h(b_i, a_j)`

    with `a = g_theta1(v1)` and `b = g_theta2(v2)`: Contrastive Multiview Coding (arXiv 1906.05849, Eq. 3 to 5),
    which the paper cites without an equation of its own.
    Differs from CMC in the negatives, which are the other frames of the batch, not a memory bank.

    Args:
        view_1: `[N, 64]`.
        view_2: `[N, 64]`, of the same frames in the same order.
        temperature: tau.
    """
    similarity = _log_similarity(view_1, view_2, temperature)
    match = similarity.diagonal()
    return (similarity.logsumexp(1) - match).mean() + (similarity.logsumexp(0) - match).mean()


def triplet_loss(
    anchor: torch.Tensor, positive: torch.Tensor, negative: torch.Tensor, margin: float
) -> torch.Tensor:
    """L_triplet, Eq. (1): `||s - s_p||^2 + max(rho - ||s - s_n||^2, 0)`, averaged over the anchors.

    Differs from the paper in that the squared distance is averaged over the dimensions, not summed (as settled from
    the authors' release: with rho = 1 a sum over 128 dimensions would be beyond the margin from the start).

    Args:
        anchor: states s `[N, D]`.
        positive: states s_p `[N, D]` of frames near the anchors.
        negative: states s_n `[N, D]` of frames far from the anchors, in the same video.
        margin: rho.
    """
    near = (anchor - positive).float().square().mean(1)
    far = (anchor - negative).float().square().mean(1)
    return (near + (margin - far).clamp(min=0)).mean()


def autoencoder_loss(picture: torch.Tensor, decoded: torch.Tensor) -> torch.Tensor:
    """L_ae: `||o - q_gamma(g_theta(o))||^2`, averaged over frames, channels and pixels, in normalized Lab.

    Differs from the paper in that the square is averaged, not summed, over the picture.

    Args:
        picture: o `[N, 3, H, W]`.
        decoded: q_gamma(g_theta(o)) `[N, 3, H, W]`.
    """
    # Through norms the squares are summed in float32 without a float32 copy of all pictures. One norm of everything
    # would lose half a percent of tens of millions of squares.
    difference = decoded - picture
    of_pictures: torch.Tensor = torch.linalg.vector_norm(difference, dim=(1, 2, 3), dtype=torch.float32)
    return of_pictures.square().sum() / difference.numel()


def prediction_loss(
    predicted: torch.Tensor, states: torch.Tensor, start: int, temperature: float
) -> torch.Tensor:
    """L_Z, Eq. (3) and (4): predicted states find the true ones among all states of their video.

    `L_Z = -1/K sum_k log h(p_{t+k}, s_{t+k}) / (h(p_{t+k}, s_{t+k}) + sum_{t' != t+k} h(p_{t+k}, s_t'))`

    averaged over the videos, with `p_{t+k}` the prediction of `s_{t+k}` (Dense Predictive Coding, arXiv 1909.04656).

    Args:
        predicted: `[B, K, D]`; entry k - 1 predicts state `start + k`.
        states: `[B, T + 1, D]`.
        start: t, the last frame the first prediction has seen; at most `T - K`.
        temperature: tau.
    """
    similarity = _log_similarity(predicted, states, temperature)
    ahead = torch.arange(predicted.shape[1], device=states.device)
    match = similarity[:, ahead, start + 1 + ahead]
    return (similarity.logsumexp(2) - match).mean()


def sequence_loss(expert: torch.Tensor, other: torch.Tensor, temperature: float) -> torch.Tensor:
    """L_O, Eq. (5): whole videos of one class are near each other and far from those of the other class.

    `L_O = -E [ log h(z, z_p) / (h(z, z_p) + sum_i h(z, z_{n,i})) ]`

    where z is an expert video, z_p the next expert video of the batch (the last one takes the first), and z_{n,i} all
    others; and the same with the roles of the two classes swapped. The expectation is the mean over the 2n anchors.

    Args:
        expert: z at the last frame, `[n, D]`.
        other: z at the last frame, `[n, D]`.
        temperature: tau.
    """
    expert, other = _unit(expert), _unit(other)
    across = expert @ other.T / temperature
    one = _contrast((expert * expert.roll(-1, 0)).sum(1) / temperature, across)
    two = _contrast((other * other.roll(-1, 0)).sum(1) / temperature, across.T)
    return (one + two) / 2


def _contrast(match: torch.Tensor, negatives: torch.Tensor) -> torch.Tensor:
    """Mean of `-log e^m / (e^m + sum_j e^n_j)` over the rows: match `[n]`, negatives `[n, m]`."""
    return (torch.cat([match[:, None], negatives], 1).logsumexp(1) - match).mean()


def _log_similarity(a: torch.Tensor, b: torch.Tensor, temperature: float) -> torch.Tensor:
    """log h of every pair: `[..., N, D]` and `[..., M, D]` to float32 `[..., N, M]`."""
    return _unit(a) @ _unit(b).transpose(-1, -2) / temperature


def _unit(vectors: torch.Tensor) -> torch.Tensor:
    """Vectors of length one, float32."""
    return F.normalize(vectors.float(), dim=-1)
