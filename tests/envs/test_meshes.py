"""Meshes with fewer triangles: nothing moves, and the model is given back as it was."""

from __future__ import annotations

import numpy as np
import pytest

from bootifol.envs.meshes import coarse_meshes, merged_vertices

POINTS = np.random.default_rng(0).normal(size=(2000, 3))
POINTS *= 0.1 / np.linalg.norm(POINTS, axis=1, keepdims=True)
BALL = f"""
<mujoco><asset><mesh name="ball" vertex="{" ".join(map(str, POINTS.ravel()))}"/></asset>
<worldbody><geom type="mesh" mesh="ball"/></worldbody></mujoco>
"""


def test_vertices_of_a_cell_become_the_one_nearest_to_their_middle() -> None:
    vertices = np.array([[0.0, 0, 0], [0.4, 0, 0], [0.25, 0, 0], [5.0, 0, 0]])

    assert merged_vertices(vertices, cell=1.0).tolist() == [2, 2, 2, 3]


def test_a_coarse_ball_is_still_that_ball_and_the_model_is_given_back() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(BALL)
    count, faces = int(model.mesh_facenum[0]), model.mesh_face.copy()

    with coarse_meshes(model, cell=0.02):
        coarse = int(model.mesh_facenum[0])
        corners = model.mesh_vert[model.mesh_face[:coarse]]

    assert 20 < coarse < count / 2
    np.testing.assert_allclose(np.linalg.norm(corners, axis=-1), 0.1, atol=0.005)
    edges = corners - np.roll(corners, 1, axis=1)
    assert (np.linalg.norm(edges, axis=-1) > 0).all()
    assert int(model.mesh_facenum[0]) == count
    assert np.array_equal(model.mesh_face, faces)


def test_a_mesh_smaller_than_a_cell_stays() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(BALL)
    count = int(model.mesh_facenum[0])

    with coarse_meshes(model, cell=1.0):
        assert int(model.mesh_facenum[0]) == count
