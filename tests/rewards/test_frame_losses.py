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


def test_exchanged_states_join_the_halves_that_they_should() -> None:
    """A state here is (u, v) = (10 * video + moment, the same), and videos of chance are 7 and 8."""
    expert = torch.tensor([[[10.0, 10.0], [11.0, 11.0]], [[20.0, 20.0], [21.0, 21.0]]])
    random = torch.tensor([[[70.0, 70.0], [71.0, 71.0]], [[80.0, 80.0], [81.0, 81.0]]])
    same, mixed = losses.exchanged(expert, expert.roll(1, 1), random)
    assert same.tolist() == [[[11, 10], [10, 11]], [[21, 20], [20, 21]]], "two moments of one video"
    assert mixed.reshape(-1, 2).tolist() == [
        *([21, 10], [20, 11], [11, 20], [10, 21]),  # both the expert's
        *([21, 70], [20, 71], [11, 80], [10, 81]),  # a random v with the expert's u
        *([70, 10], [71, 11], [80, 20], [81, 21]),  # a random u with the expert's v
    ]


def test_exchanged_states_do_without_random_videos() -> None:
    expert = torch.tensor([[10.0, 10.0], [20.0, 20.0]])
    _, mixed = losses.exchanged(expert, expert, torch.empty(0, 2))
    assert mixed.tolist() == [[20, 10], [10, 20]]


def test_exchange_loss_is_half_of_both_cross_entropies() -> None:
    same, mixed = torch.tensor([math.log(3)]), torch.tensor([0.0, math.log(3)])
    of_same = 0.25 * math.log(4 / 3) + 0.75 * math.log(4)
    of_mixed = (math.log(2) + math.log(4)) / 2
    found = float(losses.exchange_loss(same, torch.tensor([0.25]), mixed))
    assert found == pytest.approx((of_same + of_mixed) / 2)


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
    assert losses.reward(logits, 0.0).tolist() == [0.0, 0.0, 0.5, 1.0]
