"""`bootifol policy export`: a trained policy taken elsewhere."""

from __future__ import annotations

from pathlib import Path

from bootifol.cli.arguments import RunPath


def export(run: RunPath, onnx: Path | None = None, hub: Path | None = None) -> int:
    """Write a run's newest policy as an ONNX file, or as a folder that is ready for the Hugging Face hub.

    Args:
        run: Directory that `bootifol train` wrote; for --onnx its policy.safetensors alone will do.
        onnx: File to write: pictures in, actions out, for programs that have neither Python nor PyTorch.
        hub: Folder to write, which must not exist: the policy, its configuration, and a model card with pictures.
    """
    # Imported here: help should not wait for PyTorch.
    from bootifol.training.policy_export import export_policy

    written = export_policy(run, onnx, hub)
    if written.onnx is not None:
        print(
            f"{written.onnx}: {written.onnx.stat().st_size / 1e3:,.0f} kB; on random pictures onnxruntime's actions "
            f"differ from PyTorch's by {written.difference:.1g} at most"
        )
    if written.hub is not None:
        print(f"{written.hub}: {', '.join(sorted(path.name for path in written.hub.iterdir()))}")
        print(f"next: read {written.hub / 'README.md'}, then hf upload USER/{written.hub.name} {written.hub}")
    return 0
