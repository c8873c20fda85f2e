"""What the networks of every method let one choose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, Strict

from bootifol.settings import Positive, Precision


@dataclass(frozen=True)
class NetworkConfig:
    """Size, speed and arithmetic of a reward model's networks."""

    width_divisor: Annotated[int, Strict(), Field(ge=1, le=32)] = 1
    """Divides the channels of the convolutions; 1 is the network of the paper, or of its release."""

    learning_rate: Positive = 1e-4
    """Of Adam."""

    precision: Precision = "fp32"
    """bf16 computes the convolutions in bfloat16; parameters, recurrent layers, losses, rewards and Adam stay in
    float32."""
