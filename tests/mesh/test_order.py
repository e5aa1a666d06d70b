"""The order of vertices and faces belongs to the shape: not to the file's numbering, place or unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import zoo
from weathercoat.mesh import shapes
from weathercoat.mesh.frame import make_frame
from weathercoat.mesh.order import morton_codes, order_surface
from weathercoat.mesh.surface import Place, Surface, make_surface

# Grids and symmetric shapes are the hard ones: their vertices lie on the bounds of the curve's cells.
SHAPES = {
    "sheet": shapes.make_random_sheet(faces=200),
    "grid of 16": shapes.make_plate(columns=16, rows=16),
    "grid of 10": shapes.make_plate(width=2.0, columns=10, rows=10),
    "sphere": shapes.make_sphere(subdivisions=2),
    "box": shapes.make_box(cells=4),
    "hexagon": zoo.make_hexagon(4),
}


def order_in_frame(surface: Surface) -> Surface:
    return order_surface(surface, make_frame(surface).localise(surface.vertices))[0]


def test_morton_codes_of_the_corners_of_a_cube() -> None:
    """Bit i of a coordinate goes to bit 3 i + axis: x counts 1, y 2, z 4 in every triple of bits."""
    corner = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    full = sum(1 << (3 * bit) for bit in range(21))
    assert morton_codes(corner).tolist() == [full * k for k in range(8)]


@settings(max_examples=50, deadline=None)
@given(cell=st.tuples(*[st.integers(0, 2**21 - 1)] * 3))
def test_morton_codes_interleave_bits(cell: tuple[int, int, int]) -> None:
    """Against bits set one by one, for points in a cube whose corners pin its extent."""
    extent = 2**21
    points = np.array([(0, 0, 0), (extent, extent, extent), cell], float)
    expected = sum(((cell[axis] >> bit) & 1) << (3 * bit + axis) for bit in range(21) for axis in range(3))
    assert int(morton_codes(points)[2]) == expected


def test_one_place_has_one_code() -> None:
    assert len(set(morton_codes(np.ones((4, 3))).tolist())) == 1


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_renumbering_gives_the_same_bytes(name: str, seed: int) -> None:
    surface = SHAPES[name]
    first, second = order_in_frame(surface), order_in_frame(zoo.renumber(surface, seed))
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("seed", range(5))
def test_moving_and_scaling_leave_the_order(name: str, seed: int) -> None:
    """The last bits of coordinates change, and must not decide."""
    surface = SHAPES[name]
    random = np.random.default_rng(seed)
    expected = order_in_frame(surface).faces
    for vertices in (
        surface.vertices + random.uniform(-3, 3, 3),
        surface.vertices * 10.0 ** random.uniform(-6, 6),
    ):
        assert (order_in_frame(replace(surface, vertices=vertices)).faces == expected).all()


def test_it_is_the_same_surface() -> None:
    surface = zoo.renumber(shapes.make_sphere(subdivisions=1), 4)
    ordered, old_face = order_surface(surface, surface.vertices)
    centres = surface.vertices[surface.faces].mean(axis=1)
    np.testing.assert_allclose(ordered.vertices[ordered.faces].mean(axis=1), centres[old_face], atol=1e-15)
    assert (ordered.faces.argmin(axis=1) == 0).all(), "a face does not begin with its smallest vertex"
    before, after = surface.vertices[surface.faces], ordered.vertices[ordered.faces]
    normals = [np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in (before[old_face], after)]
    np.testing.assert_allclose(*normals, atol=1e-15)


def test_what_hangs_on_corners_and_vertices_moves_along() -> None:
    base = zoo.renumber(zoo.make_disc(), 2)
    corner = base.vertices[base.faces]
    surface = make_surface(
        base.vertices,
        base.faces,
        face_group=np.arange(6),
        groups=tuple("abcdef"),
        uv=corner[:, :, :2].copy(),
        colors=np.column_stack([base.vertices, np.ones(len(base.vertices))]),
        place=Place(np.arange(7, dtype=np.int32), base.vertices.copy()),
    )
    ordered, old_face = order_surface(surface, surface.vertices)
    assert ordered.uv is not None and ordered.colors is not None and ordered.place is not None
    assert (ordered.uv == ordered.vertices[ordered.faces][:, :, :2]).all()
    assert (ordered.colors[:, :3] == ordered.vertices).all()
    assert (ordered.place.barycentric == ordered.vertices).all()
    assert (base.vertices[ordered.place.face] == ordered.vertices).all()
    assert (ordered.face_group == old_face).all()


def test_neighbours_lie_near_each_other() -> None:
    """The purpose: of 2,500 vertices, those of a face are mostly within a few rows of memory."""
    surface = zoo.renumber(shapes.make_plate(columns=49, rows=49), 1)

    def median_gap(faces: np.ndarray) -> float:
        return float(np.median(faces.max(axis=1) - faces.min(axis=1)))

    ordered = order_in_frame(surface)
    assert median_gap(surface.faces) > 500
    assert median_gap(ordered.faces) < 50


def test_the_order_is_that_of_sorting_by_code_and_coordinates() -> None:
    """Points of one cell of the curve by x, y, z; those at one place as they come."""
    random = np.random.default_rng(5)
    points = random.integers(0, 3, (60, 3)) + 1e-9 * random.integers(0, 2, (60, 3))
    surface = make_surface(points, random.permutation(60).reshape(-1, 3))
    ordered, old_face = order_surface(surface, points)
    order = np.lexsort((*points.T[::-1], morton_codes(points)))
    assert (ordered.vertices == points[order]).all()
    rank = np.argsort(order)
    faces = rank[surface.faces]
    faces = np.array([np.roll(face, -face.argmin()) for face in faces])
    assert (old_face == np.lexsort(faces.T[::-1])).all()
    assert (ordered.faces == faces[old_face]).all()
