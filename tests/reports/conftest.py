import shutil
from pathlib import Path

import pytest
from synthetic_run import write_synthetic_run


@pytest.fixture(scope="session")
def shared_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole run directory, written once; tests that change it take `run_dir`."""
    return write_synthetic_run(tmp_path_factory.mktemp("runs") / "arm-1")


@pytest.fixture
def bare_run(shared_run: Path, tmp_path: Path) -> Path:
    """A run directory that holds its configuration and nothing else."""
    bare = tmp_path / "bare-1"
    bare.mkdir()
    shutil.copy(shared_run / "config.json", bare)
    return bare


@pytest.fixture
def run_dir(shared_run: Path, tmp_path: Path) -> Path:
    """A copy of the run directory to spoil."""
    return Path(shutil.copytree(shared_run, tmp_path / "arm-1"))
