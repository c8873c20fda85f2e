import torch

from bootifol.networks.sequence_encoder import SequenceEncoder, StatePredictor


def test_one_pass_gives_the_encoding_of_every_prefix() -> None:
    torch.manual_seed(0)
    encoder, states = SequenceEncoder(), torch.randn(2, 7, 128)
    encodings, _ = encoder(states)
    for t in range(7):
        prefix, _ = encoder(states[:, : t + 1])
        torch.testing.assert_close(encodings[:, t], prefix[:, -1])


def test_the_memory_goes_on_where_it_stopped() -> None:
    torch.manual_seed(0)
    encoder, states = SequenceEncoder(), torch.randn(2, 7, 128)
    before, memory = encoder(states[:, :3])
    after, _ = encoder(states[:, 3:], memory)
    torch.testing.assert_close(torch.cat([before, after], 1), encoder(states)[0])


def test_parameter_counts_are_those_of_the_paper() -> None:
    lstm = 2 * (4 * 128 * (128 + 128) + 2 * 4 * 128)
    assert sum(p.numel() for p in SequenceEncoder().parameters()) == lstm + 128 * 128 + 128
    assert sum(p.numel() for p in StatePredictor().parameters()) == 2 * (128 * 128 + 128)


def test_motion_is_the_change_of_state_whose_mean_square_is_one() -> None:
    torch.manual_seed(0)
    encoder = SequenceEncoder(motion=True)
    states = 5.0 + 0.01 * torch.randn(4, 9, 128).cumsum(1)
    inputs = encoder._with_motion(states, None)
    assert torch.equal(inputs[..., :128], states)
    assert torch.equal(inputs[:, 0, 128:], torch.zeros(4, 128))
    torch.testing.assert_close(inputs[..., 128:].square().mean(), torch.tensor(1.0), rtol=1e-3, atol=0)
    change = states[:, 3] - states[:, 2]
    cosine = torch.nn.functional.cosine_similarity(inputs[:, 3, 128:], change, dim=1)
    torch.testing.assert_close(cosine, torch.ones(4))


def test_motion_goes_on_where_the_memory_stopped_and_looks_only_back() -> None:
    torch.manual_seed(0)
    encoder = SequenceEncoder(motion=True)
    states = torch.randn(2, 8, 128)
    encoder(states)
    encoder.eval()
    whole, _ = encoder(states)
    before, memory = encoder(states[:, :3])
    after, _ = encoder(states[:, 3:], memory)
    torch.testing.assert_close(torch.cat([before, after], 1), whole)
    changed = states.clone()
    changed[:, 5:] += 1.0
    assert torch.equal(encoder(changed)[0][:, :5], whole[:, :5])
