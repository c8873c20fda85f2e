"""What `make setup` would type."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
INDEX = "https://download.pytorch.org/whl/cpu"


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")
@pytest.mark.parametrize(("words", "asked"), [([], False), ([f"TORCH_INDEX={INDEX}"], True)])
def test_setup_asks_another_index_for_pytorch_only_if_told_to(words: list[str], asked: bool) -> None:
    command = ["make", "--dry-run", "--always-make", "setup", *words]
    typed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    installs = [line for line in typed.replace("\\\n", " ").splitlines() if "--editable" in line]
    assert len(installs) == 2
    for line in installs:
        assert "--constraint constraints.txt" in line
        assert (f"--extra-index-url {INDEX}" in line) == asked
