"""Meshes with fewer triangles, for pictures in which nobody can tell: drawing in software, a robot arm of 70,000
triangles costs more than everything else of an agent step."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

_DRAWN = ("mesh_facenum", "mesh_face", "mesh_facenormal")
"""What MuJoCo uploads of a mesh to draw it, beside vertices and normals; collisions read none of it."""


@contextmanager
def coarse_meshes(model: Any, cell: float) -> Iterator[None]:
    """Inside, the meshes of a `mujoco.MjModel` have as few triangles as there are when vertices of one cell of a grid
    are one; afterwards they are as before. What is uploaded to OpenGL meanwhile stays coarse.

    Args:
        model: its meshes' faces are changed and put back.
        cell: of the grid, in meters.
    """
    before = {name: getattr(model, name).copy() for name in _DRAWN}
    try:
        for mesh in range(model.nmesh):
            _coarsen(model, mesh, cell)
        yield
    finally:
        for name, array in before.items():
            getattr(model, name)[:] = array


def _coarsen(model: Any, mesh: int, cell: float) -> None:
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    one = merged_vertices(model.mesh_vert[first : first + count], cell)
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    faces = one[model.mesh_face[first : first + count]]
    corners = np.sort(faces, axis=1)
    flat = (corners[:, 1:] == corners[:, :-1]).any(1)
    _, earliest = np.unique(corners, axis=0, return_index=True)
    kept = np.sort(earliest[~flat[earliest]])
    if not len(kept):  # smaller than a cell
        return
    model.mesh_face[first : first + len(kept)] = faces[kept]
    model.mesh_facenormal[first : first + len(kept)] = model.mesh_facenormal[first : first + count][kept]
    model.mesh_facenum[mesh] = len(kept)


def merged_vertices(vertices: NDArray[np.floating[Any]], cell: float) -> NDArray[np.int64]:
    """For each vertex the one that stands for all of its cell, the nearest to their middle.

    Args:
        vertices: `[V, 3]` in meters.
        cell: side of a cell in meters.

    Returns:
        Indices `[V]`.
    """
    _, cells = np.unique(np.round(vertices / cell).astype(np.int64), axis=0, return_inverse=True)
    cells = cells.reshape(-1)
    sizes = np.bincount(cells)
    middles = np.stack([np.bincount(cells, axis) / sizes for axis in vertices.T.astype(np.float64)], 1)
    by_cell_and_distance = np.lexsort((((vertices - middles[cells]) ** 2).sum(1), cells))
    nearest = by_cell_and_distance[np.cumsum(sizes) - sizes]
    merged: NDArray[np.int64] = nearest[cells]
    return merged
