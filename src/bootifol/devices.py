"""Where networks compute, and the two borders that data cross: to that device, and back to the host.

Environments, replay and videos are the host's; networks, their gradients and optimizers are the device's. Everything
that goes from one to the other passes `to_device` or `to_host`. On a CPU both are free.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor

from bootifol.errors import BootifolError

_NAMES = re.compile(r"auto|cpu|mps|cuda(:\d+)?")


def check_device_name(name: str) -> None:
    """Refuses what names no device on any machine.

    Raises:
        BootifolError: see there.
    """
    if not _NAMES.fullmatch(name):
        raise BootifolError(f"device must be auto, cpu, cuda, cuda:NUMBER or mps, not {name!r}")


def chosen_device(name: str) -> str:
    """The device that a name means on this machine, as PyTorch names it.

    Args:
        name: auto takes the GPU where PyTorch sees one through CUDA, else the CPU; any other name means itself.

    Raises:
        BootifolError: this machine has no such device.
    """
    check_device_name(name)
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    kind, _, number = name.partition(":")
    there = {
        "cpu": True,
        "cuda": int(number or 0) < torch.cuda.device_count(),
        "mps": torch.backends.mps.is_available(),
    }
    if not there[kind]:
        raise BootifolError(
            f"PyTorch cannot compute on {name} here: choose --device auto or cpu, or write "
            '"device": "auto" in the config.json of a run made on another machine'
        )
    return name


def to_device(tensor: Tensor, device: torch.device) -> Tensor:
    """The host's tensor on a device; the same tensor where the host is the device.

    A GPU copies from pinned memory, so that the host goes on meanwhile: from other memory it would first wait for all
    that the GPU has yet to do.
    """
    if device.type != "cuda" or tensor.device.type != "cpu":
        return tensor.to(device)
    return tensor.pin_memory().to(device, non_blocking=True)


def to_host(tensor: Tensor) -> NDArray[Any]:
    """A device's tensor as an array of the host, which waits for everything that the device has yet to do before."""
    array: NDArray[Any] = tensor.detach().cpu().numpy()
    return array


def to_floats(values: Sequence[float | Tensor]) -> list[float]:
    """Numbers of the host and scalars of one device as plain numbers, fetched all at once."""
    scalars = [value.detach().float() for value in values if isinstance(value, Tensor)]
    fetched = iter(to_host(torch.stack(scalars)).tolist() if scalars else [])
    return [next(fetched) if isinstance(value, Tensor) else value for value in values]


def usable_cores() -> int:
    """Cores that this process may use, where the system says so; else those of the machine."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
