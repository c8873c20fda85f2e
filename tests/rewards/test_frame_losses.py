"""The contrast of single frames, against values worked out by hand and loops written from the equations."""

from __future__ import annotations

import math

import pytest
import torch

from bootifol.rewards.bootifol.frames import losses


def test_frame_loss_is_half_of_both_cross_entropies() -> None:
    # sigmoid(0) = 1/2 and sigmoid(log 3) = 3/4; of the others 1 - 1/2
    expert, other = torch.tensor([0.0, math.log(3)]), torch.tensor([0.0])
    by_hand = ((math.log(2) + math.log(4 / 3)) / 2 + math.log(2)) / 2
    assert float(losses.frame_loss(expert, other, torch.ones(2))) == pytest.approx(by_hand)


def test_an_early_frame_counts_as_the_experts_by_its_lateness() -> None:
    expert, other = torch.tensor([math.log(3)]), torch.tensor([0.0])
    by_hand = (0.25 * math.log(4 / 3) + 0.75 * math.log(4) + math.log(2)) / 2
    assert float(losses.frame_loss(expert, other, torch.tensor([0.25]))) == pytest.approx(by_hand)


def test_the_second_half_of_a_video_is_late() -> None:
    frames = torch.tensor([0, 3, 6, 12])
    assert losses.lateness(frames, 13, late_from=0.5).tolist() == [0.0, 0.5, 1.0, 1.0]
    assert losses.lateness(frames, 13, late_from=0.0).tolist() == [1.0, 1.0, 1.0, 1.0]


def test_contrast_is_the_mean_of_both_ways() -> None:
    u = torch.tensor([[1.0, 0.0], [0.0, 1.0]])
    v = torch.tensor([[0.0, 1.0], [0.6, 0.8]])
    tau = 0.5
    similarity = [[0.0 / tau, 0.6 / tau], [1.0 / tau, 0.8 / tau]]
    terms = []
    for i in range(2):
        forth = sum(math.exp(similarity[i][j]) for j in range(2))
        back = sum(math.exp(similarity[j][i]) for j in range(2))
        terms += [math.log(forth) - similarity[i][i], math.log(back) - similarity[i][i]]
    assert float(losses.contrast(u, v, tau)) == pytest.approx(sum(terms) / 4)


def test_contrast_of_groups_is_the_mean_over_groups() -> None:
    u, v = (torch.nn.functional.normalize(torch.randn(3, 4, 5), dim=-1) for _ in range(2))
    by_group = [float(losses.contrast(a, b, 0.1)) for a, b in zip(u, v, strict=True)]
    assert float(losses.contrast(u, v, 0.1)) == pytest.approx(sum(by_group) / 3, rel=1e-5)


@pytest.mark.parametrize(
    ("of_expert", "of_agent", "least"), [(0.2, 0.8, 0.25), (0.5, 0.5, 1.0), (0.6, 0.3, 1.0)]
)
def test_the_agents_frames_lose_only_what_they_show_more_often_than_the_expert(
    of_expert: float, of_agent: float, least: float
) -> None:
    """Where a frame is shown with these densities, the chance that makes L least is min(1, p_e / p_a)."""
    chances = torch.linspace(0.001, 0.999, 999)
    logits = torch.log(chances / (1 - chances))
    risks = [
        of_expert * float(torch.nn.functional.softplus(-x)) + of_agent * float(losses.bootstrap_loss(x[None]))
        for x in logits
    ]
    found = float(chances[risks.index(min(risks))])
    assert found == pytest.approx(least, abs=0.003)


def test_rewards_are_cut_logits() -> None:
    logits = torch.tensor([-20.0, 0.0, 2.5, 20.0])
    assert losses.reward(logits).tolist() == [-1.0, 0.0, 0.5, 1.0]
