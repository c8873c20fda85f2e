"""Source archive and wheel: what is in them, and that the wheel works where nothing of the checkout is."""

from __future__ import annotations

import email
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.message import Message
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

LEFT_OUT = shutil.ignore_patterns(
    ".*", "__pycache__", "*.egg-info", "build", "dist", "site", "runs", "demos", "demo", "*.pyc"
)
"""Of the checkout: what git ignores, and git's own."""


def run(*words: str, **options: object) -> str:
    done = subprocess.run(words, capture_output=True, text=True, **options)  # type: ignore[call-overload]
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return str(done.stdout)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the source archive, and the wheel that was made from it."""
    pytest.importorskip("build")
    root = tmp_path_factory.mktemp("built")
    # Folders of these names lie deeper in the checkout, too, where they are its own.
    checkout = shutil.copytree(
        ROOT,
        root / "checkout",
        ignore=lambda folder, names: (
            LEFT_OUT(folder, names)
            if Path(folder) == ROOT
            else shutil.ignore_patterns("__pycache__")(folder, names)
        ),
    )
    for stray in checkout.rglob("*.egg-info"):
        shutil.rmtree(stray)
    run(
        sys.executable,
        "-m",
        "build",
        "--no-isolation",
        "--outdir",
        str(root / "dist"),
        str(checkout),
        cwd=root,
    )
    return root / "dist"


@pytest.fixture(scope="module")
def site(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the wheel is installed, without what it needs."""
    target = tmp_path_factory.mktemp("site")
    (wheel,) = built.glob("*.whl")
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-compile")
    run(*pip, "--target", str(target), str(wheel))
    return target


def files_of(folder: str) -> set[str]:
    """The checkout's files in a folder, by their path in it."""
    found = [path for path in (ROOT / folder).rglob("*") if path.is_file()]
    return {
        str(path.relative_to(ROOT))
        for path in found
        if "__pycache__" not in path.parts and not any(part.endswith(".egg-info") for part in path.parts)
    }


def metadata_of(built: Path) -> Message:
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        return email.message_from_bytes(archive.read(name))


def test_the_source_archive_has_tests_pages_and_constraints(built: Path) -> None:
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        inside = {name.partition("/")[2] for name in packed.getnames()}
    wanted = {
        "constraints.txt",
        "CHANGELOG.md",
        "CITATION.cff",
        "CONTRIBUTING.md",
        "LICENSE",
        "Makefile",
        "README.md",
    }
    for folder in ("src", "tests", "docs", "benchmarks", "examples", "scripts", "results"):
        wanted |= files_of(folder)
    assert len(wanted) > 400
    assert wanted - inside == set()
    assert not any("__pycache__" in name or name.endswith(".pyc") for name in inside)


def test_the_wheel_has_the_package_with_its_data_and_nothing_else(built: Path, site: Path) -> None:
    inside = {f"src/{path.relative_to(site)}" for path in site.rglob("*") if path.is_file()}
    inside = {name for name in inside if not re.match(r"src/(bin/|[^/]+\.dist-info/)", name)}
    assert inside == files_of("src")
    for ending in (".css", ".html", ".md", ".safetensors", "py.typed"):
        assert any(name.endswith(ending) for name in inside), ending


def test_the_wheel_is_used_far_from_the_checkout(site: Path, tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(site)}
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]

    def python(*words: str) -> str:
        return run(sys.executable, *words, cwd=tmp_path, env=environment)

    assert python("-m", "bootifol", "--version") == f"bootifol {version}\n"
    assert "drawn_reach" in python("-m", "bootifol", "tasks")
    code = """
import bootifol, jinja2
from bootifol.experts import BUNDLED
from bootifol.files import read_arrays
templates = jinja2.PackageLoader("bootifol.reports", "templates").list_templates()
print(bootifol.__file__, sorted(templates), len(read_arrays(BUNDLED / "walker_run.safetensors", "the expert")))
"""
    said = python("-c", code)
    assert said.startswith(str(site))
    assert "['model_card.md', 'page.html', 'style.css']" in said
    assert int(said.split()[-1]) > 0, "arrays of the bundled expert"


def test_a_package_index_shows_no_link_that_leads_nowhere(built: Path) -> None:
    metadata = metadata_of(built)
    assert metadata["Description-Content-Type"] == "text/markdown"
    shown = str(metadata.get_payload())
    assert re.findall(r"\]\((?!https?://)[^)]*\)", shown) == [], "relative links"
    assert "# bootifol" in shown and "(https://arxiv.org/abs/2302.06540)" in shown
    assert "pip install '.[dm-control,metaworld]'" in shown, "code is as it was"
    assert "use a policy (docs/use_a_policy.md)" in shown


def test_authors_are_those_of_the_citation_and_no_address_is_made_up(built: Path) -> None:
    metadata = metadata_of(built)
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nauthors:\n  - name: {metadata['Author']}\n" in citation
    assert f"\nversion: {metadata['Version']}\n" in citation
    assert metadata["License-Expression"] == "MIT"
    assert metadata.get_all("Project-URL") is None
