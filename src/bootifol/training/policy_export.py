"""A run's policy taken elsewhere: one ONNX file, or a folder that the Hugging Face hub shows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bootifol.agents.policy import PolicyNetworks, read_networks
from bootifol.errors import BootifolError
from bootifol.reports.run_files import read_run
from bootifol.training.saved_policy import NAME
from bootifol.types import AnyPath


@dataclass(frozen=True)
class PolicyExport:
    """What was written."""

    onnx: Path | None
    difference: float | None
    """The largest difference of an action of onnxruntime from one of PyTorch, on random pictures."""

    hub: Path | None


def export_policy(run: AnyPath, onnx: AnyPath | None = None, hub: AnyPath | None = None) -> PolicyExport:
    """Writes a run's newest policy for other programs and for other people.

    Args:
        run: the run's directory; for `onnx` its `policy.safetensors` alone will do.
        onnx: the ONNX file to write (`agents/policy_onnx.py` says what goes in and out); it needs the extra `onnx`.
        hub: the folder to write, for `hf upload`: the policy, its configuration, and a model card with pictures. It
            must not exist.

    Raises:
        BootifolError: neither is asked for, the run has no policy of its own, a package is missing, or nothing can be
            written.
    """
    if onnx is None and hub is None:
        raise BootifolError("say what to export: --onnx FILE, --hub DIRECTORY, or both")
    networks = read_networks(_policy_file(Path(run)))
    target = None if onnx is None else Path(onnx)
    folder = None if hub is None else Path(hub)
    if target is not None and target.suffix != ".onnx":
        raise BootifolError(f"--onnx {target} is to be a file whose name ends in .onnx")
    if folder is not None:
        _require_folder_can_be(folder, Path(run))
    difference = None
    if target is not None:
        from bootifol.agents.policy_onnx import write_onnx

        difference = write_onnx(target, networks)
    if folder is not None:
        _write_folder(folder, Path(run), networks)
    return PolicyExport(target, difference, folder)


def _policy_file(run: Path) -> Path:
    """The file of a run's policy.

    Raises:
        BootifolError: there is none.
    """
    if not run.is_dir():
        return run
    file = run / NAME
    if not file.is_file():
        read_run(run)  # which says so where there is no run
        raise BootifolError(
            f"{run} has no {NAME}: a run writes it with its first checkpoint, unless its agent acts on encodings of a "
            "reward model that goes on learning (agent.observations encodings), which no such file holds"
        )
    return file


def _require_folder_can_be(folder: Path, run: Path) -> None:
    if folder.exists():
        raise BootifolError(f"{folder} exists already: choose another directory or remove it")
    if not run.is_dir():
        raise BootifolError(
            f"--hub needs the directory of a run, whose curves and videos the model card shows, not {run} alone"
        )


def _write_folder(folder: Path, run: Path, networks: PolicyNetworks) -> None:
    from bootifol.reports.model_card import write_model_folder

    write_model_folder(folder, run, networks.config)
