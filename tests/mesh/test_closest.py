"""Closest points by the tree against all faces, and against points of the triangle tried one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weathercoat.mesh import shapes
from weathercoat.mesh.closest import closest_on_triangle, find_closest, make_closest_tree


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), faces=st.integers(1, 40), flat=st.booleans())
def test_it_finds_what_trying_every_face_finds(seed: int, faces: int, flat: bool) -> None:
    """Any triangles, needles and ones without area among them, and any hints."""
    random = np.random.default_rng(seed)
    vertices = random.uniform(-1, 1, (12, 3)) * (1, 1, 0 if flat else 1)
    faces_of = random.integers(0, 12, (faces, 3)).astype(np.int32)
    points = random.uniform(-1.5, 1.5, (20, 3))
    face, near = find_closest(
        make_closest_tree(vertices, faces_of), points, random.integers(0, faces, 20).astype(np.int32)
    )
    for point, f, q in zip(points, face, near, strict=True):
        distances = [closest_on_triangle(*point, *vertices[corner].ravel())[0] for corner in faces_of]
        assert distances[f] == min(distances)
        assert (closest_on_triangle(*point, *vertices[faces_of[f]].ravel())[1:] == q).all()


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 10**6), squeeze=st.sampled_from([1.0, 1e-3, 1e-6, 1e-9, 0.0]))
def test_no_other_point_of_a_triangle_is_nearer(seed: int, squeeze: float) -> None:
    """Weights on a grid over the triangle; slivers lose about half of the digits."""
    random = np.random.default_rng(seed)
    triangle = random.uniform(-1, 1, (3, 3))
    triangle[2] = squeeze * triangle[2] + (1 - squeeze) * (0.3 * triangle[0] + 0.7 * triangle[1])
    point = random.uniform(-1, 1, 3)
    squared, *near = closest_on_triangle(*point, *triangle.ravel())
    assert squared == pytest.approx(float(np.sum((np.array(near) - point) ** 2)), rel=1e-12)
    weights = np.array([(i, j, 60 - i - j) for i in range(61) for j in range(61 - i)]) / 60.0
    assert np.sqrt(squared) <= np.sqrt(np.sum((weights @ triangle - point) ** 2, axis=1).min()) + 1e-7


def test_the_point_lies_on_the_triangle() -> None:
    """Corner, edge and inside of a known triangle."""
    triangle = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    assert closest_on_triangle(0.25, 0.25, 2.0, *triangle) == (4.0, 0.25, 0.25, 0.0)
    assert closest_on_triangle(-1.0, -2.0, 0.0, *triangle) == (5.0, 0.0, 0.0, 0.0)
    assert closest_on_triangle(1.0, 1.0, 0.0, *triangle) == (0.5, 0.5, 0.5, 0.0)


def test_of_faces_equally_near_the_hint_is_taken() -> None:
    sphere = shapes.make_sphere(subdivisions=1)
    tree = make_closest_tree(sphere.vertices, sphere.faces)
    hint = np.arange(len(sphere.faces), dtype=np.int32)
    for corner in range(3):
        points = sphere.vertices[sphere.faces[:, corner]]
        face, near = find_closest(tree, points, hint)
        assert (face == hint).all()
        assert (near == points).all()
