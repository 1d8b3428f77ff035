"""A mesh as trimesh has it: the same surface with the same colours, and a copy."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.scenes.boards import cabinet_twin
from twin.scene import Mesh, Texture


def test_vertices_faces_and_colours_are_the_same() -> None:
    mesh = cabinet_twin().parts[0].mesh
    made = mesh.to_trimesh()
    np.testing.assert_array_equal(made.vertices, mesh.vertices)
    np.testing.assert_array_equal(made.faces, mesh.faces)
    np.testing.assert_array_equal(made.visual.vertex_colors[:, :3], mesh.colors)
    assert made.area == pytest.approx(mesh.area)


def test_a_photograph_comes_along() -> None:
    """The left half of the picture is red; so is what the left half of the square shows."""
    image = np.zeros((4, 8, 3), np.uint8)
    image[:, :4, 0] = 255
    image[:, 4:, 2] = 255
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    texture = Texture(square[faces][:, :, :2].astype(np.float32), image, np.ones((4, 8), bool))
    made = Mesh(square, faces, None, texture).to_trimesh()
    assert made.area == pytest.approx(1.0)
    np.testing.assert_array_equal(np.asarray(made.visual.material.image), image)
    np.testing.assert_allclose(made.visual.uv, made.vertices[:, :2])
    colours = made.visual.to_color().vertex_colors
    assert (colours[made.vertices[:, 0] < 0.5, 0] == 255).all()
    assert (colours[made.vertices[:, 0] > 0.5, 2] == 255).all()


def test_the_mesh_does_not_change_with_its_copy() -> None:
    mesh = cabinet_twin().parts[0].mesh
    before = mesh.vertices.copy()
    made = mesh.to_trimesh()
    made.vertices += 1.0
    made.faces[0] = 0
    np.testing.assert_array_equal(mesh.vertices, before)
