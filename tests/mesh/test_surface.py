"""Surfaces on plain arrays."""

from __future__ import annotations

import numpy as np

from tests import zoo
from weathercoat.mesh import shapes
from weathercoat.mesh.surface import face_normals, vertex_normals


def test_normals_do_not_depend_on_how_many_faces_are_worked_on_at_a_time() -> None:
    """Bit for bit those of the formula over all faces at once; more faces than are taken at a time."""
    surface = zoo.renumber(shapes.make_torus(segments=120, sides=48), 1)
    vertices, faces = surface.vertices, surface.faces
    corner = vertices[faces]
    normal = face_normals(vertices, faces)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    expected = np.zeros_like(vertices)
    for i in range(3):
        a, b = corner[:, (i + 1) % 3] - corner[:, i], corner[:, (i + 2) % 3] - corner[:, i]
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
        for axis in range(3):
            expected[:, axis] += np.bincount(faces[:, i], normal[:, axis] * angle, len(vertices))
    expected = expected / np.linalg.norm(expected, axis=1, keepdims=True)
    assert vertex_normals(vertices, faces).tobytes() == expected.tobytes()


def test_a_vertex_without_area_has_no_normal() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [5, 5, 5]])
    normal = vertex_normals(vertices, np.array([[0, 1, 2], [0, 1, 3]], np.int32))
    assert (normal[[0, 1, 3]] == [0.0, 0.0, 1.0]).all()
    assert (normal[[2, 4]] == 0.0).all()
