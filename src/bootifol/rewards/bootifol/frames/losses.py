"""The contrast of single frames: pure functions of logits and features, one equation each.

Beyond the paper. Notation: x is the head's logit of a frame, u and v are projections of length 1 of its features.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F


def frame_loss(expert: torch.Tensor, other: torch.Tensor, lateness: torch.Tensor) -> torch.Tensor:
    """L_F: the head tells the expert's frames from others, and its late ones from its early ones.

    `L_F = -(E_expert[ w log sigmoid(x) + (1 - w) log sigmoid(-x) ] + E_other[ log sigmoid(-x) ]) / 2`

    An expert begins where anybody begins: where it has got to is what it is for. So a frame counts as the expert's
    with its lateness w. It is log 2 for a head that knows nothing.

    Args:
        expert: logits `[N]` of the expert's frames.
        other: logits `[M]` of random videos; without any, the expert's frames alone count.
        lateness: w `[N]` of the expert's frames, in [0, 1].
    """
    bce = F.binary_cross_entropy_with_logits
    of_others = F.softplus(other.float()).mean() if len(other) else 0.0
    return (bce(expert.float(), lateness) + of_others) / 2


def lateness(frame: torch.Tensor, frames: int, late_from: float) -> torch.Tensor:
    """w of L_F: `min(1, t / (c T))` of frame t of a video of T + 1 frames, 1 throughout where c is 0.

    Args:
        frame: t, of any shape.
        frames: T + 1.
        late_from: c, the part of a video after which a frame counts in full.
    """
    if late_from == 0:
        return torch.ones_like(frame, dtype=torch.float32)
    return (frame / (late_from * (frames - 1))).clamp(max=1.0).float()


def exchanged(
    expert: torch.Tensor, another: torch.Tensor, random: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """States whose halves are of two frames, for L_X.

    Args:
        expert: `[N, ..., Z]` of expert frames; neighbors along N are of different videos.
        another: `[N, ..., Z]` of other moments of the same videos.
        random: `[M, ..., Z]` of random videos, at most N.

    Returns:
        The expert's v with the u of another moment of its video `[N, ..., Z]`, and u and v of two videos
        `[N + 2 M, ..., Z]`: both the expert's, or one of them random.
    """
    (u, _), (_, v), (random_u, random_v) = (states.chunk(2, -1) for states in (another, expert, random))
    elsewhere, count = u.roll(1, 0), len(random)
    pairs = ((elsewhere, v), (elsewhere[:count], random_v), (random_u, v[:count]))
    return torch.cat((u, v), -1), torch.cat([torch.cat(pair, -1) for pair in pairs])


def exchange_loss(same: torch.Tensor, lateness: torch.Tensor, mixed: torch.Tensor) -> torch.Tensor:
    """L_X: the halves of a state belong together where they are of one video, whatever its moments.

    `L_X = -(E_same[ w log sigmoid(x) + (1 - w) log sigmoid(-x) ] + E_mixed[ log sigmoid(-x) ]) / 2`

    u tells where an episode's goal is, v what the agent has done. An expert's v with another video's u has done what
    was not asked for: a failure that no video shows. An expert's v with u of another moment has done it still. Without
    such pairs a head with few videos learns by heart which v goes with which u.

    Args:
        same: logits `[N]` of v of expert frames with u of another moment of the same videos.
        lateness: w `[N]` of the frames that v is of, in [0, 1].
        mixed: logits `[M]` of u and v of two videos, one of them at least the expert's.
    """
    bce = F.binary_cross_entropy_with_logits
    return (bce(same.float(), lateness) + F.softplus(mixed.float()).mean()) / 2


def bootstrap_loss(agent: torch.Tensor) -> torch.Tensor:
    """L_B: the agent's frames that are not the expert's get less; those that are lose nothing.

    `L_B = E_agent[ sigmoid(x) ]`

    The agent's frames are unlabeled: some are failures, some are as good as the expert's. Beside `-E_expert[ log
    sigmoid(x) ]`, and where no random frame is, the sum is least at `sigmoid(x) = min(1, p_e / p_a)`: only what the
    agent shows more often than the expert does loses. With the logarithm of L_F it would be `p_e / (p_e + p_a)`, and
    the better the agent, the less its successes would get. (Bounded losses for positive and unlabeled data: du Plessis,
    Niu and Sugiyama, 2014; Kiryo et al., 2017.)

    Args:
        agent: logits `[N]` of the agent's frames.
    """
    return torch.sigmoid(agent.float()).mean()


def contrast(anchors: torch.Tensor, positives: torch.Tensor, temperature: float) -> torch.Tensor:
    """InfoNCE, both ways: each anchor finds its positive among the group's, and each positive its anchor.

    `-log( exp(u_i v_i / tau) / sum_j exp(u_i v_j / tau) )`, averaged over i, both ways and groups.

    L_E: a group holds a frame of each video of a batch, and the positives are another moment of the same videos. Only
    what stays through an episode, and differs between episodes, tells them apart: where its goal is.
    L_T: a group holds some moments of one video, and the positives are frames next to them. Only what changes through
    an episode tells them apart: what the agent moves.

    Args:
        anchors: u `[..., K, D]`, of length 1.
        positives: v `[..., K, D]`, likewise.
        temperature: tau.

    Returns:
        The loss: log K for projections that say nothing.
    """
    similarity = anchors @ positives.transpose(-1, -2) / temperature
    diagonal = torch.diagonal(similarity, dim1=-2, dim2=-1)
    ways = (torch.logsumexp(similarity, -1) - diagonal, torch.logsumexp(similarity, -2) - diagonal)
    return torch.stack(ways).mean()


def reward(logits: torch.Tensor, floor: float = -1.0) -> torch.Tensor:
    """What a frame gets: `x / 5`, cut at b and 1, float32 of the logits' shape. It still rises where the head is sure.

    Args:
        logits: x.
        floor: b, in [-1, 0].
    """
    return (logits.float() / 5).clamp(floor, 1.0)
