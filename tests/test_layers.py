"""Imports follow the way of the data and never point back."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import bootifol

PACKAGE = Path(bootifol.__file__).parent

LAYERS = [
    "video_files",
    "envs",
    "experts",
    "demos",
    "networks",
    "rewards",
    "replay",
    "agents",
    "evaluation",
    "reports",
]
"""From the videos to the report; a layer may import those before it."""

SHARED = {
    "types",
    "errors",
    "checksums",
    "locks",
    "output",
    "files",
    "hub",
    "devices",
    "progress",
    "tasks",
    "malloc",
    "old_names",
    "optim",
    "plugins",
    "settings",
}
"""Modules without a place in the order: everyone may import them."""

ABOVE = {"training", "api", "sweep", "cli", "presets", "tracking"}
"""What sees all layers; no layer may import it."""


def imported_areas(module: Path) -> set[str]:
    areas = set()
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("bootifol."):
            areas.add(node.module.split(".")[1])
        if isinstance(node, ast.Import):
            areas |= {name.name.split(".")[1] for name in node.names if name.name.startswith("bootifol.")}
    return areas


@pytest.mark.parametrize("layer", LAYERS)
def test_a_layer_imports_only_layers_before_it(layer: str) -> None:
    allowed = set(LAYERS[: LAYERS.index(layer) + 1]) | SHARED
    for module in sorted((PACKAGE / layer).rglob("*.py")):
        beyond = imported_areas(module) - allowed
        assert not beyond, f"{module.relative_to(PACKAGE)} imports {sorted(beyond)}"


def test_training_knows_no_method_by_name() -> None:
    for module in sorted((PACKAGE / "training").rglob("*.py")):
        tree = ast.parse(module.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                area, _, what = node.module.removeprefix("bootifol.").partition(".")
                assert area != "rewards" or what in ("base", "config", "references", "registry"), module


def test_every_area_has_a_place() -> None:
    areas = {path.stem if path.is_file() else path.name for path in PACKAGE.iterdir()}
    assert areas - {"__init__", "__main__", "__pycache__", "py"} <= set(LAYERS) | SHARED | ABOVE
