"""BootIfOL's four networks in one module."""

from __future__ import annotations

import torch
from torch import nn

from bootifol.networks.feature_encoder import FeatureEncoder
from bootifol.networks.frame_decoder import FrameDecoder
from bootifol.networks.frame_encoders import FrameEncoder
from bootifol.networks.sequence_encoder import SequenceEncoder, StatePredictor
from bootifol.rewards.bootifol.config import BootifolConfig

LEAK = 0.2
"""Slope of LeakyReLU below zero."""


class BootifolNetworks(nn.Module):
    """g_theta, q_gamma, f_omega and d_phi.

    Args:
        config: see there.
        video_size: side of the videos in pixels.
        feature_size: of a frozen backbone, which is no part of this module; g_theta then reads features, and there is
            no q_gamma. None: g_theta reads pixels.
    """

    def __init__(self, config: BootifolConfig, video_size: int, feature_size: int | None = None) -> None:
        super().__init__()
        self.frame_encoder: FrameEncoder | FeatureEncoder
        self.frame_decoder: FrameDecoder | None
        if feature_size is None:
            self.frame_encoder = FrameEncoder(video_size, config.width_divisor, LEAK)
            self.frame_decoder = FrameDecoder(video_size, config.width_divisor, LEAK)
        else:
            self.frame_encoder = FeatureEncoder(feature_size, LEAK)
            self.frame_decoder = None
        self.sequence_encoder = SequenceEncoder(config.motion)
        self.state_predictor = StatePredictor(LEAK)

    def encode_and_predict(
        self, states: torch.Tensor, start: int, count: int
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Encodes whole videos and, from frame `start`, predicts the `count` states that follow (K of L_Z).

        The LSTM reads every true state once: it stops at `start` to branch off the predictions, then goes on.
        Each predicted state is fed back into f_omega for the next one.

        Args:
            states: `[B, T + 1, 128]`.
            start: t, below T.
            count: K.

        Returns:
            z `[B, T + 1, 128]` and predicted states `[B, K, 128]`.
        """
        before, memory = self.sequence_encoder(states[:, : start + 1])
        after, _ = self.sequence_encoder(states[:, start + 1 :], memory)
        predicted = [self.state_predictor(before[:, -1])]
        while len(predicted) < count:
            encoding, memory = self.sequence_encoder(predicted[-1][:, None], memory)
            predicted.append(self.state_predictor(encoding[:, 0]))
        return torch.cat([before, after], dim=1), torch.stack(predicted, dim=1)
