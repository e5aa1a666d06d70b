"""Repair on plain arrays: the result is an oriented manifold with the area of the input, whatever came in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from weathercoat.errors import NoAreaError, NoFacesError, WeathercoatError
from weathercoat.mesh import topology
from weathercoat.mesh.formats.polygons import Polygons
from weathercoat.mesh.repair import repair, weld
from weathercoat.mesh.surface import Surface
from weathercoat.mesh.triangulate import triangulate


def repaired(positions: object, faces: list[list[int]], **more: object) -> Surface:
    polygons = Polygons(
        positions=np.array(positions, float),
        corners=np.array([i for face in faces for i in face], np.int64),
        sizes=np.array([len(face) for face in faces], np.int64),
        **more,  # type: ignore[arg-type]
    )
    return repair(polygons, up=(0.0, 0.0, 1.0), name="test", format="obj", max_faces=10**6)


def notes_of(surface: Surface) -> dict[str, int]:
    return {note.code: note.count for note in surface.notes}


def assert_is_oriented_manifold(surface: Surface) -> None:
    faces = surface.faces
    directed = np.stack([faces.ravel(), np.roll(faces, -1, axis=1).ravel()], axis=1)
    assert len(np.unique(directed, axis=0)) == len(directed)
    assert np.array_equal(np.unique(faces), np.arange(len(surface.vertices)))
    twin, crowded = topology.match_twins(surface.vertices, faces)
    assert not len(crowded)
    _, parent = topology.split_vertices(len(surface.vertices), faces, twin)
    assert len(parent) == len(surface.vertices)
    orientation = topology.orient(surface.vertices, faces, twin)
    assert orientation.cut == 0
    assert not orientation.flipped.any()


def box(
    low: tuple[float, float, float], high: tuple[float, float, float]
) -> tuple[list[list[float]], list[list[int]]]:
    positions = [
        [(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    ]
    return positions, [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def strip(count: int, twist: float) -> tuple[list[list[float]], list[list[int]]]:
    """A closed band of `count` quads, twisted by `twist` half turns: 0 a cylinder, 1 a Moebius strip."""
    positions = []
    for i in range(count):
        angle, tilt = 2 * np.pi * i / count, np.pi * twist * i / count
        for side in (-0.3, 0.3):
            radius = 1 + side * np.sin(tilt)
            positions.append([radius * np.cos(angle), radius * np.sin(angle), side * np.cos(tilt)])
    faces = [[2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1] for i in range(count - 1)]
    last = 2 * count - 2
    faces.append([last, 1, 0, last + 1] if twist % 2 else [last, 0, 1, last + 1])
    return positions, faces


@pytest.mark.parametrize("start", range(6))
@pytest.mark.parametrize("turned", [False, True])
def test_concave_polygon_keeps_its_area(start: int, turned: bool) -> None:
    positions = [[0, 0, 0], [3, 0, 0], [3, 3, 0], [2, 3, 0], [2, 1, 0], [0, 1, 0]]
    face = np.roll(np.arange(6), start).tolist()
    surface = repaired(positions, [face[::-1] if turned else face])
    assert surface.area() == pytest.approx(5.0)
    assert len(surface.faces) == 4
    assert notes_of(surface) == {"W-POLYGONS": 1, "W-BOUNDARY": 6}


@pytest.mark.parametrize("start", range(4))
def test_concave_quad_is_cut_along_its_inner_diagonal(start: int) -> None:
    face = np.roll(np.arange(4), start).tolist()
    assert repaired([[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0]], [face]).area() == pytest.approx(1.0)


def test_star_shaped_comb_and_large_polygons() -> None:
    angle = np.linspace(0, 2 * np.pi, 5000, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    star = circle * np.where(np.arange(5000) % 2, 1.0, 0.5)[:, None]
    for polygon in (circle, star):
        x, y = polygon[:, 0], polygon[:, 1]
        shoelace = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        triangles, _ = triangulate(polygon, np.arange(5000), np.array([5000]))
        assert len(triangles) == 4998
        assert Surface(polygon, triangles.astype(np.int32), np.zeros(4998, np.int32)).area() == pytest.approx(
            shoelace
        )


def test_self_crossing_polygon_ends() -> None:
    random = np.random.default_rng(1).normal(size=(300, 3))
    triangles, polygon = triangulate(random, np.arange(300), np.array([300]))
    assert len(triangles) == 298
    assert set(polygon) == {0}


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_weld_merges_rounding_and_keeps_thin_sheets(scale: float) -> None:
    positions = scale * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1 + 5e-8, 1, 0], [1, 1, 1e-6]])
    vertex, kept, merged = weld(positions, np.arange(5))
    assert vertex.tolist() == [0, 1, 2, 2, 3]
    assert kept.tolist() == [0, 1, 2, 4]
    assert merged == 1


def test_weld_does_not_let_one_far_vertex_collapse_the_rest() -> None:
    positions = np.vstack([np.random.default_rng(2).random((20000, 3)), [[1e12, 1e12, 1e12]]])
    _, _, merged = weld(positions, np.arange(len(positions)))
    assert merged == 0


def test_cap_in_the_interior_is_flipped_without_a_crack() -> None:
    positions = [[0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 2, 0], [1, -2, 0]]
    surface = repaired(
        positions,
        [[0, 2, 3], [0, 1, 2], [2, 1, 3], [0, 4, 1]],
        uv=np.array(
            [[0, 0], [1, 0], [1, 2], [0, 0], [2, 0], [1, 0], [1, 0], [2, 0], [1, 2], [0, 0], [1, -2], [2, 0]],
            float,
        ),
    )
    assert notes_of(surface) == {"W-DEGENERATE": 1, "W-BOUNDARY": 4}
    assert surface.area() == pytest.approx(4.0)
    assert surface.uv is not None
    assert np.allclose(surface.uv, surface.vertices[surface.faces][..., :2])


def test_needle_closes_without_a_crack() -> None:
    """A corner of the box is two points, further apart than welding reaches, with needles between them."""
    positions, faces = box((0, 0, 0), (4, 4, 1))
    positions += [[4, 4, 1 + 1.8e-7]]
    faces[1] = [4, 6, 8, 5]
    faces[3] = [2, 3, 8, 6]
    faces += [[3, 7, 8], [7, 5, 8]]
    surface = repaired(positions, faces)
    assert notes_of(surface) == {"W-POLYGONS": 6, "W-DEGENERATE": 2}
    assert len(surface.vertices) == 8
    assert_is_oriented_manifold(surface)


def test_degenerate_duplicate_unreferenced_and_nonfinite_are_counted() -> None:
    positions, faces = box((0, 0, 0), (1, 1, 1))
    positions += [[5, 5, 5], [np.nan, 0, 0], [np.inf, 0, 0]]
    surface = repaired(positions, [*faces, [0, 0, 1], [0, 1], [4, 6, 7], [0, 1, 10]])
    assert notes_of(surface) == {
        "W-NONFINITE": 1,
        "W-POLYGONS": 6,
        "W-UNREFERENCED": 2,
        "W-DEGENERATE": 2,
        "W-DUPLICATE": 1,
    }
    assert surface.area() == pytest.approx(6.0)


def test_flipped_and_inverted() -> None:
    positions, faces = box((0, 0, 0), (1, 1, 1))
    inside_out = [face[::-1] for face in faces]
    assert notes_of(repaired(positions, inside_out)) == {"W-POLYGONS": 6, "W-INVERTED": 12}
    mixed = [*faces[:2], *inside_out[2:]]
    surface = repaired(positions, mixed)
    assert notes_of(surface) == {"W-POLYGONS": 6, "W-FLIPPED": 8}
    assert_is_oriented_manifold(surface)
    corner = surface.vertices[surface.faces]
    assert np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) == pytest.approx(6.0)


def test_open_sheet_keeps_the_side_of_most_of_its_area() -> None:
    positions, faces = strip(12, 0)
    faces[3] = faces[3][::-1]
    surface = repaired(positions, faces)
    assert notes_of(surface) == {"W-POLYGONS": 12, "W-FLIPPED": 2, "W-BOUNDARY": 24}


@pytest.mark.parametrize("count", [3, 4, 12, 101])
def test_moebius_strip_is_cut_once(count: int) -> None:
    surface = repaired(*strip(count, 1))
    notes = notes_of(surface)
    assert notes["W-NONORIENTABLE"] == 1
    assert "W-COMPONENTS" not in notes
    assert_is_oriented_manifold(surface)
    assert surface.area() == pytest.approx(
        sum(repaired(strip(count, 1)[0], [f]).area() for f in strip(count, 1)[1])
    )


def test_projective_plane_is_cut() -> None:
    """The six-vertex triangulation has no boundary and no two sides: every cut must open it somewhere."""
    faces = [
        [0, 1, 2],
        [0, 2, 3],
        [0, 3, 4],
        [0, 4, 5],
        [0, 5, 1],
        [1, 2, 4],
        [2, 3, 5],
        [3, 4, 1],
        [4, 5, 2],
        [5, 1, 3],
    ]
    surface = repaired(np.random.default_rng(4).normal(size=(6, 3)), faces)
    assert notes_of(surface)["W-NONORIENTABLE"] == 1
    assert len(surface.faces) == 10
    assert_is_oriented_manifold(surface)


def test_two_cubes_that_touch_in_an_edge_come_apart_whole() -> None:
    one, faces = box((0, 0, 0), (1, 1, 1))
    other, _ = box((1, 1, 0), (2, 2, 1))
    surface = repaired(one + other, faces + [[8 + i for i in face] for face in faces])
    assert notes_of(surface) == {"W-POLYGONS": 12, "W-WELDED": 2, "W-NONMANIFOLD": 1, "W-COMPONENTS": 2}
    assert len(surface.vertices) == 16
    assert_is_oriented_manifold(surface)


def test_crossing_sheets_stay_whole() -> None:
    positions = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]]
    surface = repaired(positions, [[4, 5, 0], [5, 4, 1], [4, 5, 2], [5, 4, 3]])
    assert notes_of(surface) == {"W-NONMANIFOLD": 1, "W-BOUNDARY": 8, "W-COMPONENTS": 2}
    assert_is_oriented_manifold(surface)


def test_bowtie_vertex_is_split() -> None:
    surface = repaired([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], [[0, 1, 2], [0, 3, 4]])
    assert notes_of(surface) == {"W-NONMANIFOLD-VERTEX": 1, "W-BOUNDARY": 6, "W-COMPONENTS": 2}
    assert len(surface.vertices) == 6


def test_edge_of_very_many_faces_ends() -> None:
    angle = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    pages = np.stack([np.cos(angle), np.sin(angle), 0 * angle + 0.5], axis=1)
    surface = repaired(np.vstack([[[0, 0, 0], [0, 0, 1]], pages]), [[0, 1, 2 + i] for i in range(500)])
    assert notes_of(surface)["W-NONMANIFOLD"] == 1
    assert notes_of(surface)["W-SOUP"] == 500
    assert_is_oriented_manifold(surface)


def test_nothing_usable() -> None:
    with pytest.raises(NoFacesError):
        repaired([[0, 0, 0]], [])
    with pytest.raises(NoAreaError):
        repaired([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]])
    with pytest.raises(NoAreaError):
        repaired([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1]])


@st.composite
def any_polygons(draw: st.DrawFn) -> tuple[NDArray[np.float64], list[list[int]]]:
    """Few points on a coarse lattice, some moved by less than an edge, and faces among them at random."""
    points = draw(st.lists(st.tuples(*[st.integers(0, 2)] * 3), min_size=3, max_size=12))
    positions = np.array(points, float)
    for i in draw(st.lists(st.integers(0, len(points) - 1), max_size=4)):
        positions[i] += 10.0 ** -draw(st.integers(1, 17))
    index = st.integers(0, len(points) - 1)
    return positions, draw(st.lists(st.lists(index, min_size=1, max_size=6), min_size=1, max_size=24))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(any_polygons())
def test_whatever_comes_in_an_oriented_manifold_comes_out(
    polygons: tuple[NDArray[np.float64], list[list[int]]],
) -> None:
    try:
        surface = repaired(*polygons)
    except WeathercoatError as error:
        assert error.exit_code == 4
        return
    assert_is_oriented_manifold(surface)
    assert (surface.face_areas() > 0).all()
