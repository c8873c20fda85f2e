"""DrQ-v2 against values worked out by hand and against the plain version."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from benchmarks.plain.drqv2 import PlainDrQv2, PlainEncoder
from torch import nn

from bootifol.agents.config import DrQv2Config
from bootifol.agents.drqv2 import (
    DrQv2,
    actor_loss,
    cloning_loss,
    critic_loss,
    critic_target,
    noisy_action,
    saturation_loss,
)
from bootifol.errors import BootifolError
from bootifol.files import read_arrays, write_arrays
from bootifol.types import Batch, StepMetrics

SIZE, STACK, ACTIONS, BATCH = 24, 2, 3, 16
SMALL = DrQv2Config(feature_dim=8, hidden_dim=16, batch_size=BATCH, precision="fp32", warm_up_steps=0)


def make_batch(seed: int = 0, size: int = SIZE) -> Batch:
    generator = torch.Generator().manual_seed(seed)

    def pictures() -> torch.Tensor:
        stacked = torch.randint(
            0, 256, (BATCH, 3 * STACK, size, size), dtype=torch.uint8, generator=generator
        )
        return stacked.contiguous(memory_format=torch.channels_last)

    return Batch(
        observation=pictures(),
        action=torch.rand(BATCH, ACTIONS, generator=generator) * 2 - 1,
        reward=torch.randn(BATCH, generator=generator),
        discount=torch.full((BATCH,), 0.97),
        next_observation=pictures(),
    )


def make_agent(config: DrQv2Config = SMALL, seed: int = 0, size: int = SIZE) -> DrQv2:
    return DrQv2(config, size, STACK, ACTIONS, seed)


def plain_twin(agent: DrQv2) -> PlainDrQv2:
    """The plain version with the same parameters (its features are flattened channels first)."""
    plain = PlainDrQv2(SIZE, STACK, ACTIONS, feature_dim=8, hidden=16)
    names = ("first", *(f"rest.{i}" for i in range(3)))
    fast = agent.encoder.state_dict()
    plain.encoder.load_state_dict(
        {
            f"layers.{2 * i}.{kind}": fast[f"{name}.{kind}"].contiguous()
            for i, name in enumerate(names)
            for kind in ("weight", "bias")
        }
    )
    channels, height, width = plain.encoder.last
    for slow_network, network in (
        (plain.actor, agent.actor),
        (plain.critic, agent.critic),
        (plain.target_critic, agent.target_critic),
    ):
        state = {
            name.replace("hidden.", "").replace("output.", "4."): tensor.clone()
            for name, tensor in network.state_dict().items()
        }
        weight = state["trunk.0.weight"].view(8, height, width, channels)
        state["trunk.0.weight"] = weight.permute(0, 3, 1, 2).reshape(8, -1)
        slow_network.load_state_dict(state)
    return plain


def generator_of(agent: DrQv2) -> torch.Generator:
    generator = torch.Generator()
    generator.set_state(torch.from_numpy(agent.state()["generator"]))
    return generator


def test_critic_target_by_hand() -> None:
    target = critic_target(
        reward=torch.tensor([1.0, 2.0]),
        discount=torch.tensor([0.5, 0.0]),
        next_q1=torch.tensor([4.0, 100.0]),
        next_q2=torch.tensor([6.0, 3.0]),
    )
    assert target.tolist() == [1 + 0.5 * 4, 2.0]


def test_losses_by_hand() -> None:
    q1, q2 = torch.tensor([1.0, 2.0]), torch.tensor([3.0, -1.0])
    target = torch.tensor([2.0, 2.0])
    assert critic_loss(q1, q2, target).item() == (1 + 0) / 2 + (1 + 9) / 2
    assert actor_loss(q1, q2).item() == -(1 + -1) / 2


def test_saturation_loss_by_hand() -> None:
    assert saturation_loss(torch.tensor([[1.0, -2.0], [0.0, 3.0]])).item() == (1 + 4 + 0 + 9) / 4


@pytest.mark.parametrize(("weight", "comes_back"), [(0.0, False), (0.01, True)])
def test_a_saturated_actor_comes_back_with_the_saturation_loss_alone(weight: float, comes_back: bool) -> None:
    agent = make_agent(dataclasses.replace(SMALL, saturation_weight=weight, learning_rate=0.05))
    with torch.no_grad():
        agent.actor.policy.output.bias.fill_(12.0)
    saturated = [agent.update(make_batch(i), 10**6)["agent/saturated"] for i in range(100)]
    assert saturated[0] == 1.0
    assert (saturated[-1] < 0.9) == comes_back


def test_updates_are_those_of_the_plain_version() -> None:
    agent = make_agent()
    plain = plain_twin(agent)
    config = agent.config
    for i in range(4):
        agent_steps = 100_000 * i
        noise = generator_of(agent)
        stddev = config.exploration(agent_steps)
        next_noise, actor_noise = (torch.randn(BATCH, ACTIONS, generator=noise) * stddev for _ in range(2))
        metrics = agent.update(make_batch(i), agent_steps)
        expected = plain.update(make_batch(i), next_noise, actor_noise)
        assert metrics["agent/critic_loss"] == pytest.approx(expected["critic_loss"], rel=1e-4)
        assert metrics["agent/actor_loss"] == pytest.approx(expected["actor_loss"], rel=1e-3, abs=1e-5)
    twin = plain_twin(agent)
    for network in ("encoder", "actor", "critic", "target_critic"):
        for name, found in getattr(twin, network).state_dict().items():
            close = torch.isclose(found, getattr(plain, network).state_dict()[name], rtol=1e-3, atol=2e-5)
            # Adam turns a gradient that is only rounding error into a full step, so a few may differ.
            assert close.float().mean() > 0.995, (network, name)


def test_bfloat16_agrees_with_float32() -> None:
    exact, rounded = make_agent(), make_agent(dataclasses.replace(SMALL, precision="bf16"))
    for i in range(3):
        expected, found = exact.update(make_batch(i), i), rounded.update(make_batch(i), i)
        assert found["agent/critic_loss"] == pytest.approx(float(expected["agent/critic_loss"]), rel=0.05)
        assert found["agent/q"] == pytest.approx(float(expected["agent/q"]), abs=0.05)
    assert all(p.dtype == torch.float32 for p in rounded.critic.parameters())


@pytest.mark.parametrize(
    ("name", "convolutions"),
    [
        ("paper", [(32, 3, 2), (32, 3, 1), (32, 3, 1), (32, 3, 1)]),
        ("strided", [(32, 3, 2), (32, 3, 2), (32, 3, 1), (32, 3, 1)]),
        ("coarse", [(32, 8, 4), (64, 4, 2), (64, 3, 1)]),
    ],
)
def test_encoders_are_the_documented_ones(name, convolutions) -> None:
    agent = make_agent(dataclasses.replace(SMALL, encoder=name), size=64)
    plain = PlainEncoder(3 * STACK, 64, convolutions)
    assert [p.shape for p in agent.encoder.parameters()] == [p.shape for p in plain.parameters()]
    plain.load_state_dict(
        dict(zip(plain.state_dict(), map(torch.clone, agent.encoder.state_dict().values()), strict=True))
    )
    pixels = make_batch(size=64).observation.float()
    expected = plain(pixels).view(BATCH, *plain.last).permute(0, 2, 3, 1).flatten(1)
    torch.testing.assert_close(agent.encoder(pixels), expected, rtol=1e-4, atol=1e-5)


def test_paper_sizes() -> None:
    agent = DrQv2(DrQv2Config(), frame_size=84, stack=3, action_dim=2, seed=0)
    assert agent.encoder.feature_count == 32 * 35 * 35
    assert [tuple(p.shape) for p in agent.critic.q1.parameters()] == [
        (1024, 52),
        (1024,),
        (1024, 1024),
        (1024,),
        (1, 1024),
        (1,),
    ]
    weight = agent.actor.policy.hidden[2].weight
    torch.testing.assert_close(weight @ weight.T, torch.eye(1024), atol=1e-4, rtol=0)
    kernel = agent.encoder.first.weight.flatten(1)
    torch.testing.assert_close(kernel @ kernel.T, 2 * torch.eye(32), atol=1e-4, rtol=0)
    assert not agent.encoder.first.bias.any()


def test_noise_schedule() -> None:
    config = DrQv2Config()
    assert config.exploration(0) == 1.0
    assert config.exploration(250_000) == pytest.approx(0.55)
    assert config.exploration(500_000) == config.exploration(10**7) == pytest.approx(0.1)
    assert DrQv2Config(exploration_steps=0).exploration(0) == pytest.approx(0.1)


def test_noise_is_clipped_and_actions_stay_in_range() -> None:
    generator = torch.Generator().manual_seed(0)
    mean = torch.linspace(-1, 1, 21)[:, None].expand(21, 500)
    noisy = noisy_action(mean, 0.5, 0.3, generator)
    assert noisy.abs().max() <= 1
    assert (noisy - mean).abs().max() <= 0.3 + 1e-6
    middle = noisy[10]
    clipped = (middle.abs() > 0.299).float().mean()
    assert clipped == pytest.approx(0.5485, abs=0.06)  # P(|noise| > 0.6 standard deviations)
    unclipped = noisy_action(torch.zeros(20_000), 0.2, None, generator)
    assert unclipped.std() == pytest.approx(0.2, abs=0.01)
    assert unclipped.abs().max() > 0.6


def test_gradient_passes_straight_through_the_borders() -> None:
    mean = torch.tensor([[-0.99, 0.0, 0.99]], requires_grad=True)
    action = noisy_action(mean, 5.0, 10.0, torch.Generator().manual_seed(0))
    assert action.abs().max() == 1
    action.sum().backward()
    assert mean.grad is not None and mean.grad.tolist() == [[1.0, 1.0, 1.0]]


def test_the_actor_does_not_train_the_encoder() -> None:
    agent = make_agent()
    agent.critic.q2.load_state_dict(agent.critic.q1.state_dict())
    batch = make_batch()
    with torch.no_grad():  # rewards that make the critic's loss exactly zero
        reward, _ = agent.critic(agent.encoder(batch.observation.float()), batch.action)
    before = agent.state()
    metrics = agent.update(dataclasses.replace(batch, reward=reward, discount=torch.zeros(BATCH)), 0)
    assert metrics["agent/critic_loss"] == 0
    after = agent.state()
    unchanged = {name for name in before if np.array_equal(before[name], after[name])}
    assert {name for name in before if name.startswith(("encoder.", "critic."))} <= unchanged
    assert "actor.policy.output.weight" not in unchanged


def test_the_critic_trains_the_encoder() -> None:
    agent = make_agent()
    before = agent.state()
    agent.update(make_batch(), 0)
    after = agent.state()
    assert all(
        not np.array_equal(before[name], after[name]) for name in before if name.startswith("encoder.")
    )


def test_cloning_trains_encoder_and_actor_and_nothing_else() -> None:
    agent = make_agent()
    before = agent.state()
    batch = make_batch()
    losses = [agent.clone(batch, 1e-3)["agent/cloning_loss"] for _ in range(40)]
    assert losses[-1] < 0.5 * losses[0]
    after = agent.state()
    for name in before.keys() - {"generator"}:
        assert np.array_equal(before[name], after[name]) == name.startswith(("critic.", "target_critic."))


def cloning_agent(critic_bias: float = 0.0) -> DrQv2:
    """With equal critics, which a `satisfied` batch leaves as they are."""
    agent = make_agent(dataclasses.replace(SMALL, cloning_weight=10.0))
    with torch.no_grad():
        agent.critic.q1.output.bias.fill_(critic_bias)
    agent.critic.q2.load_state_dict(agent.critic.q1.state_dict())
    return agent


def satisfied(agent: DrQv2, batch: Batch) -> Batch:
    """The batch with the rewards that the critic expects: its loss is 0, and only cloning trains the encoder."""
    with torch.no_grad():
        reward, _ = agent.critic(agent.encoder(batch.observation.float()), batch.action)
    return dataclasses.replace(batch, reward=reward, discount=torch.zeros(BATCH))


def updated(agent: DrQv2, batch: Batch) -> tuple[DrQv2, StepMetrics]:
    """A copy of the agent after an update, and the metrics of that."""
    copy = make_agent(agent.config)
    copy.load_state(agent.state())
    return copy, copy.update(batch, 0)


SHOWN = torch.arange(BATCH) < 3


def test_demonstrated_rows_pull_actor_and_encoder() -> None:
    agent = cloning_agent()
    batch = satisfied(agent, make_batch())
    cloned, _ = updated(agent, dataclasses.replace(batch, demonstrated=SHOWN))
    other, _ = updated(agent, batch)

    def distance(encoder: nn.Module, actor: nn.Module) -> float:
        with torch.no_grad():
            action = actor(encoder(batch.observation.float()))
        return float(cloning_loss(action[SHOWN], batch.action[SHOWN]))

    before = distance(agent.encoder, agent.actor)
    assert distance(other.encoder, agent.actor) == before > distance(cloned.encoder, agent.actor)
    assert distance(agent.encoder, cloned.actor) < min(before, distance(agent.encoder, other.actor))


def test_other_rows_do_not_pull() -> None:
    agent = cloning_agent()
    batch = dataclasses.replace(make_batch(), demonstrated=SHOWN)
    changed = dataclasses.replace(batch, action=torch.where(SHOWN[:, None], batch.action, -batch.action))
    (one, metrics), (other, its_metrics) = (
        updated(agent, satisfied(agent, each)) for each in (batch, changed)
    )
    assert metrics["agent/cloning_loss"] == its_metrics["agent/cloning_loss"]
    for name in ("encoder.first.weight", "actor.policy.output.weight"):
        np.testing.assert_array_equal(one.state()[name], other.state()[name])


@pytest.mark.parametrize("critic_bias", [0.0, -7.0])
def test_cloning_terms_by_hand(critic_bias: float) -> None:
    """`cloning_weight * max(mean |Q|, 1)` times the cloning loss, for the actor and for the encoder."""
    agent = cloning_agent(critic_bias)
    batch = satisfied(agent, make_batch())
    scale = max(float(batch.reward.abs().mean()), 1.0)  # the rewards are the critic's Q
    assert (scale == 1.0) == (critic_bias == 0.0)
    action = agent.actor(agent.encoder(batch.observation.float()))
    loss = (action - batch.action)[:3].square().mean()
    (gradient,) = torch.autograd.grad(loss, [agent.encoder.first.weight])

    cloned, metrics = updated(agent, dataclasses.replace(batch, demonstrated=SHOWN))
    _, without = updated(agent, batch)
    assert float(metrics["agent/cloning_loss"]) == pytest.approx(loss.item(), rel=1e-5)
    added = float(metrics["agent/actor_loss"]) - float(without["agent/actor_loss"])
    assert added == pytest.approx(10 * scale * loss.item(), rel=1e-4)
    # Adam's average after one step is a tenth of the gradient.
    average = cloned.state()["critic_adam/exp_avg/encoder.first.weight"]
    np.testing.assert_allclose(average, scale * gradient, rtol=1e-3, atol=1e-6)


def test_target_critic_follows_slowly() -> None:
    agent = make_agent(dataclasses.replace(SMALL, tau=0.25))
    agent.update(make_batch(0), 0)
    before = agent.state()
    agent.update(make_batch(1), 0)
    after = agent.state()
    for name in (name for name in before if name.startswith("target_critic.")):
        expected = 0.75 * before[name] + 0.25 * after[name.removeprefix("target_")]
        np.testing.assert_allclose(after[name], expected, rtol=1e-5, atol=1e-7)


def test_the_averaged_policy_follows_slowly_and_acts_without_exploration() -> None:
    agent = make_agent(dataclasses.replace(SMALL, ema_decay=0.75))
    newest = make_agent(SMALL)
    states = [agent.state()]
    for _ in range(6):
        agent.update(make_batch(), 0)
        newest.update(make_batch(), 0)
        states.append(agent.state())
    averaged = [name for name in states[0] if name.startswith("averaged_") and "/" not in name]
    assert len(averaged) == sum(name.startswith(("encoder.", "actor.")) for name in states[0])
    for name in averaged:
        moved = [state[name.removeprefix("averaged_")] for state in states]
        # Means of what the updates made, without the initial parameters, until 0.25 is more than 1 / (updates).
        np.testing.assert_allclose(states[3][name], np.mean(moved[1:4], axis=0), rtol=1e-4, atol=1e-6)
        expected = 0.75 * states[5][name] + 0.25 * moved[6]
        np.testing.assert_allclose(states[6][name], expected, rtol=1e-5, atol=1e-7)
    observation = make_batch(9).observation[0].permute(1, 2, 0).contiguous().numpy()
    same, other = (
        [one.act(observation, 10**9, explore=explore) for one in (agent, newest)] for explore in (True, False)
    )
    np.testing.assert_array_equal(*same)
    assert not np.array_equal(*other)


@pytest.mark.parametrize("ema_decay", [0.0, 0.9])
@pytest.mark.parametrize("precision", ["bf16", "fp32"])
def test_state_is_exact(tmp_path, precision, ema_decay) -> None:
    config = dataclasses.replace(SMALL, precision=precision, ema_decay=ema_decay)
    agent = make_agent(config)
    for i in range(2):
        agent.clone(make_batch(i), 1e-3)
        agent.update(make_batch(i), i)
    write_arrays(tmp_path / "agent.safetensors", agent.state())
    resumed = make_agent(config, seed=7)
    resumed.update(make_batch(5), 5)
    resumed.load_state(read_arrays(tmp_path / "agent.safetensors", "the agent"))
    observation = make_batch(9).observation[0].permute(1, 2, 0).contiguous().numpy()
    assert agent.clone(make_batch(2), 1e-3) == resumed.clone(make_batch(2), 1e-3)
    for i in range(2, 4):
        assert agent.update(make_batch(i), i) == resumed.update(make_batch(i), i)
        for explore in (True, False):
            actions = [one.act(observation, 10, explore=explore) for one in (agent, resumed)]
            np.testing.assert_array_equal(*actions)
    states = agent.state(), resumed.state()
    assert states[0].keys() == states[1].keys()
    for name, array in states[0].items():
        np.testing.assert_array_equal(array, states[1][name])


def test_a_state_before_any_update_forgets_the_optimizers() -> None:
    agent, used = make_agent(), make_agent(seed=3)
    used.update(make_batch(3), 0)
    used.load_state(agent.state())
    assert agent.update(make_batch(1), 0) == used.update(make_batch(1), 0)
    np.testing.assert_array_equal(agent.state()["critic_adam/step/encoder.first.weight"], 1)
    np.testing.assert_array_equal(used.state()["critic_adam/step/encoder.first.weight"], 1)


def test_state_is_a_copy() -> None:
    agent = make_agent()
    state = agent.state()
    kept = {name: array.copy() for name, array in state.items()}
    agent.update(make_batch(), 0)
    for name, array in state.items():
        np.testing.assert_array_equal(array, kept[name])


def test_the_global_generator_is_left_alone() -> None:
    before = torch.get_rng_state()
    agent = make_agent()
    agent.update(make_batch(), 0)
    agent.act(make_batch().observation[0].permute(1, 2, 0).contiguous().numpy(), 0, explore=True)
    assert torch.equal(torch.get_rng_state(), before)


def test_same_seed_same_agent() -> None:
    one, same, other = (make_agent(seed=seed).state() for seed in (1, 1, 2))
    assert all(np.array_equal(one[name], same[name]) for name in one)
    assert not np.array_equal(one["actor.policy.output.weight"], other["actor.policy.output.weight"])


def test_acting() -> None:
    agent = make_agent()
    observation = make_batch().observation[0].permute(1, 2, 0).contiguous().numpy()
    greedy = [agent.act(observation, 200, explore=False) for _ in range(2)]
    np.testing.assert_array_equal(*greedy)
    assert greedy[0].dtype == np.float32 and greedy[0].shape == (ACTIONS,)
    with torch.no_grad():
        picture = torch.from_numpy(observation).permute(2, 0, 1)[None].float()
        expected = agent.actor(agent.encoder(picture))[0].numpy()
    np.testing.assert_allclose(greedy[0], expected, atol=1e-6)

    early = np.array([agent.act(observation, 0, explore=True) for _ in range(300)])
    assert np.abs(early).max() == 1
    late = np.array([agent.act(observation, 500_000, explore=True) for _ in range(300)])
    np.testing.assert_allclose((late - expected).std(), 0.1, atol=0.02)


@pytest.mark.parametrize("encoder", ["paper", "strided", "coarse"])
def test_it_learns_what_a_picture_asks_for(encoder) -> None:
    """Bright pictures ask for positive actions, dark ones for negative; a wrong sign anywhere cannot learn it."""
    config = DrQv2Config(
        encoder=encoder,
        feature_dim=16,
        hidden_dim=64,
        learning_rate=1e-3,
        exploration_steps=50,
        warm_up_steps=0,
    )
    agent = DrQv2(config, 36, stack=1, action_dim=1, seed=0)
    rng = np.random.default_rng(0)
    pictures = np.stack([np.full((3, 36, 36), value, dtype=np.uint8) for value in (50, 200)])
    for i in range(60):
        bright = rng.integers(2, size=32)
        action = rng.uniform(-1, 1, (32, 1)).astype(np.float32)
        reward = (action[:, 0] * (2 * bright - 1)).astype(np.float32)
        seen = torch.from_numpy(pictures[bright]).contiguous(memory_format=torch.channels_last)
        agent.update(
            Batch(seen, torch.from_numpy(action), torch.from_numpy(reward), torch.zeros(32), seen), i
        )
    for picture, sign in zip(pictures, (-1, 1), strict=True):
        chosen = agent.act(picture.transpose(1, 2, 0).copy(), 0, explore=False)
        assert float(chosen[0]) * sign > 0.5


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_loss_that_is_not_finite_is_a_sentence(bad: float) -> None:
    agent = make_agent()
    before = agent.state()
    with pytest.raises(BootifolError, match=r"loss of the agent's critic is (nan|inf)"):
        agent.update(dataclasses.replace(make_batch(), reward=torch.full((BATCH,), bad)), 0)
    after = agent.state()
    assert all(np.array_equal(before[name], after[name]) for name in before if name != "generator")


def test_mistakes_are_sentences() -> None:
    with pytest.raises(BootifolError, match="too small for the agent's 'coarse' encoder"):
        DrQv2(dataclasses.replace(SMALL, encoder="coarse"), 20, STACK, ACTIONS, 0)
    with pytest.raises(BootifolError, match="does not fit"):
        make_agent().load_state(make_agent(dataclasses.replace(SMALL, hidden_dim=8)).state())
    for field, value in (
        ("hidden_dim", 0),
        ("discount", 1.5),
        ("noise_clip", -0.1),
        ("learning_rate", 0.0),
        ("encoder", "big"),
        ("precision", "fp8"),
    ):
        with pytest.raises(BootifolError, match=field):
            dataclasses.replace(SMALL, **{field: value})
