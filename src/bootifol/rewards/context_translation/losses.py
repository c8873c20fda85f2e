"""The three losses of context translation and its cost: pure functions of tensors, one equation each.

Notation: `o_t^i` is frame t of expert video i, in [-1, 1]; `Enc1` encodes it, `Enc2` encodes the first frame of another
video j, its context; `T` translates between the two, `Dec` draws features as a picture in that context:

    F(o_t^i, o_0^j) = T(Enc1(o_t^i), Enc2(o_0^j))       translated features
    M(o_t^i, o_0^j) = Dec(F(o_t^i, o_0^j))              translated picture

Total: `L = L_trans + lambda_1 L_rec + lambda_2 L_align`; the weights are in the config. The losses differ from the
paper in that squares are averaged over the picture (or the features), not summed, so that weights do not depend on the
size of the pictures. The cost, from which the reward is made, sums as the paper does. Everything is float32.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F


def translation_loss(translated: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """L_trans: `||M(o_t^i, o_0^j) - o_t^j||^2`, the translation against what video j shows at the same time.

    Args:
        translated: M `[N, 3, H, W]`.
        target: `o_t^j` `[N, 3, H, W]`.
    """
    return F.mse_loss(translated.float(), target.float())


def reconstruction_loss(decoded: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """L_rec: `||Dec(Enc1(o_t^j)) - o_t^j||^2`; it keeps in the features of a frame what its picture shows.

    Args:
        decoded: `Dec(Enc1(o_t^j))` `[N, 3, H, W]`, drawn in the context of video j, as translations are.
        target: `o_t^j` `[N, 3, H, W]`.
    """
    return F.mse_loss(decoded.float(), target.float())


def alignment_loss(translated: torch.Tensor, features: torch.Tensor) -> torch.Tensor:
    """L_align: `||F(o_t^i, o_0^j) - Enc1(o_t^j)||^2`; without it, distances between the two would mean nothing.

    Args:
        translated: F `[N, D]`.
        features: `Enc1(o_t^j)` `[N, D]`.
    """
    return F.mse_loss(translated.float(), features.float())


def imitation_cost(
    features: torch.Tensor,
    translated_features: torch.Tensor,
    pictures: torch.Tensor,
    translated_pictures: torch.Tensor,
    image_weight: float,
) -> torch.Tensor:
    """`||Enc1(o_t) - 1/n sum_i F(o_t^i, o_0)||^2 + w_rec ||o_t - 1/n sum_i M(o_t^i, o_0)||^2`; minus it is the reward.

    Args:
        features: `Enc1(o_t)` `[T, D]` of the agent's frames.
        translated_features: the mean of F over the n expert videos, `[T, D]`.
        pictures: the agent's frames `o_t` `[T, 3, H, W]`.
        translated_pictures: the mean of M over the n expert videos, `[T, 3, H, W]`.
        image_weight: w_rec.

    Returns:
        float32 `[T]`, 0 or more.
    """
    of_features = (features.float() - translated_features.float()).square().sum(1)
    of_pictures = (pictures.float() - translated_pictures.float()).square().sum((1, 2, 3))
    return of_features + image_weight * of_pictures
