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
