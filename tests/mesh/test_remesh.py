"""Remeshing: a valid manifold of the same topology after every pass, even, random and true to the input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.measure_remesh import (
    bends,
    count_bad_faces,
    edge_lengths,
    euler_number,
    find_edges,
    find_topology_defects,
    flat_part_order,
    line_distance,
    make_box_with_hole,
    make_cube,
    make_grid,
    sampled_distance,
    smallest_angles,
)
from tests.zoo import (
    make_annulus,
    make_disc,
    make_hexagon,
    make_hinge,
    make_octahedron,
    make_roof,
    make_tetrahedron,
    make_triangle,
    make_two_pieces,
    renumber,
)
from weathercoat.errors import LimitError
from weathercoat.mesh import remesh as remesh_module
from weathercoat.mesh.connectivity import EditableMesh, compact
from weathercoat.mesh.creases import find_features
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.read import read_surface
from weathercoat.mesh.remesh import RemeshParameters, remesh
from weathercoat.mesh.surface import Surface, face_normals, make_surface

ZOO = {
    "triangle": make_triangle,
    "hinge": lambda: make_hinge(0.9),
    "tetrahedron": make_tetrahedron,
    "octahedron": make_octahedron,
    "disc": make_disc,
    "hexagon": make_hexagon,
    "annulus": make_annulus,
    "two pieces": make_two_pieces,
    "roof": make_roof,
    "cube": make_cube,
    "box with a hole": make_box_with_hole,
}


def check_editable(mesh: EditableMesh, euler: int) -> None:
    """Twins, fans, features and topology of a mesh that is being edited."""
    count = 3 * int(mesh.count[1])
    tail, twin, crease = mesh.tail[:count], mesh.twin[:count], mesh.crease[:count]
    alive = np.flatnonzero(tail >= 0)
    head = tail[alive - alive % 3 + (alive + 1) % 3]
    paired = twin[alive] >= 0
    opposite = twin[alive[paired]]
    assert np.array_equal(twin[opposite], alive[paired])
    assert np.array_equal(tail[opposite], head[paired])
    assert np.array_equal(crease[opposite], crease[alive[paired]])
    assert np.all(crease[alive[~paired]] >= 0), "a boundary is always a feature"
    used = np.unique(tail[alive])
    start = mesh.half_edge[used]
    assert np.array_equal(tail[start], used)
    on_boundary = np.zeros(len(mesh.half_edge), np.bool_)
    on_boundary[tail[alive[~paired]]] = True
    assert np.array_equal(twin[start] < 0, on_boundary[used])
    surface = make_surface(mesh.position, tail[alive].reshape(-1, 3))
    assert find_topology_defects(surface.faces) == []
    assert euler_number(surface) == euler


@pytest.fixture
def checked_passes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Checks the mesh after every pass of the loop; the list gets the Euler number to expect."""
    euler: list[int] = []
    for name in ("_split", "_collapse", "_remove_poor_faces"):
        inner = getattr(remesh_module, name)

        def checked(*arguments: object, inner: object = inner) -> EditableMesh:
            mesh = inner(*arguments)  # type: ignore[operator]
            check_editable(mesh, euler[0])
            return mesh

        monkeypatch.setattr(remesh_module, name, checked)
    for name in ("flip_edges", "_relax"):
        inner = getattr(remesh_module, name)

        def checked_in_place(mesh: EditableMesh, *arguments: object, inner: object = inner) -> None:
            inner(mesh, *arguments)  # type: ignore[operator]
            check_editable(mesh, euler[0])

        monkeypatch.setattr(remesh_module, name, checked_in_place)
    return euler


@pytest.mark.parametrize("name", ZOO)
@pytest.mark.parametrize("faces", [4, 300])
def test_every_pass_keeps_a_valid_mesh(name: str, faces: int, checked_passes: list[int]) -> None:
    surface = ZOO[name]()
    checked_passes.append(euler_number(surface))
    result = remesh(surface, RemeshParameters(faces=faces, iterations=6))
    assert find_topology_defects(result.faces) == []
    if faces > 4:  # where edges are longer than the shape, there is no face below to compare with
        assert count_bad_faces(result, surface) == (0, 0)


@pytest.mark.parametrize(
    "surface",
    [make_grid(1), make_grid(50), make_cube(), make_box_with_hole()],
    ids=["plate", "grid", "cube", "box with a hole"],
)
def test_triangles_are_even_and_lines_kept(surface: Surface) -> None:
    result = remesh(surface, RemeshParameters(faces=3000))
    edges = find_edges(result.faces)
    length = edge_lengths(result, edges)
    angle = smallest_angles(result)
    diagonal = surface.diagonal()
    assert abs(len(result.faces) / 3000 - 1) <= 0.02
    assert length.std() / length.mean() <= 0.12
    assert np.median(angle) >= (52 if np.mean(bends(result, edges) > np.radians(30)) > 0.05 else 54)
    assert angle.min() >= 10
    assert line_distance(result, surface) <= 1e-6 * diagonal
    assert max(*sampled_distance(surface, result), *sampled_distance(result, surface)) <= 2e-3 * diagonal


@pytest.mark.parametrize("columns", [1, 50])
def test_no_direction_of_a_coarse_or_gridded_plate_is_left(columns: int) -> None:
    order = flat_part_order(remesh(make_grid(columns), RemeshParameters(faces=10_000)))
    assert order is not None
    assert max(order) <= 0.06


def test_corners_of_a_cube_stay() -> None:
    result = remesh(make_cube(), RemeshParameters(faces=500))
    nearest = np.linalg.norm(make_cube().vertices[:, None] - result.vertices[None], axis=2).min(axis=1)
    assert np.all(nearest < 1e-12)
    assert result.area() == pytest.approx(6.0, abs=1e-9)


def test_places_give_the_vertices() -> None:
    surface = make_box_with_hole()
    result = remesh(surface, RemeshParameters(faces=2000))
    assert result.place is not None
    assert np.all(result.place.barycentric >= 0)
    np.testing.assert_allclose(result.place.barycentric.sum(axis=1), 1.0, atol=1e-12)
    corners = surface.vertices[surface.faces[result.place.face]]
    placed = np.einsum("ij,ijk->ik", result.place.barycentric, corners)
    np.testing.assert_allclose(placed, result.vertices, atol=1e-12)


def test_borders_of_groups_are_lines() -> None:
    plate = make_grid(10)
    centre = plate.vertices[plate.faces].mean(axis=1)
    plate = replace(plate, face_group=(centre[:, 0] > 0.5).astype(np.int32), groups=("body", "trim"))
    result = remesh(plate, RemeshParameters(faces=1000))
    side = result.vertices[result.faces].mean(axis=1)[:, 0] > 0.5
    assert np.array_equal(result.face_group == 1, side)
    assert result.groups == ("body", "trim")
    assert result.face_areas()[side].sum() == pytest.approx(0.5, abs=1e-9)


def test_the_sides_of_a_thin_plate_do_not_mix() -> None:
    box = make_cube()
    thin = replace(box, vertices=box.vertices * [1.0, 1.0, 0.004])
    result = remesh(thin, RemeshParameters(faces=1500))
    assert find_topology_defects(result.faces) == []
    assert count_bad_faces(result, thin) == (0, 0)
    normal = face_normals(result.vertices, result.faces)
    flat = np.abs(normal[:, 2]) > 0.9 * np.linalg.norm(normal, axis=1)
    height = result.vertices[result.faces][flat][:, :, 2]
    assert np.all(np.ptp(height, axis=1) < 1e-9)


def test_creases_of_a_noisy_scan_do_not_multiply_faces() -> None:
    random = np.random.default_rng(1)
    grid = make_grid(80)
    vertices = grid.vertices.copy()
    vertices[:, 2] = 0.1 * np.sin(3 * vertices[:, 0]) + random.normal(0, 0.006, len(vertices))
    scan = replace(grid, vertices=vertices)
    edges = find_edges(scan.faces)
    assert np.mean(bends(scan, edges) > np.radians(30)) > 0.3, "the scan is noisy enough to test something"
    result = remesh(scan, RemeshParameters(faces=1000))
    assert abs(len(result.faces) / 1000 - 1) <= 0.02
    assert find_topology_defects(result.faces) == []


def test_small_components_survive() -> None:
    cube, offset = make_cube(), 0
    vertices, faces = [], []
    for i in range(8):
        size = 10.0 ** -(i % 4)
        vertices.append(cube.vertices * size + [2.0 * i, 0, 0])
        faces.append(cube.faces + offset)
        offset += len(cube.vertices)
    result = remesh(
        make_surface(np.concatenate(vertices), np.concatenate(faces)), RemeshParameters(faces=200)
    )
    assert find_topology_defects(result.faces) == []
    assert euler_number(result) == 16


def test_same_seed_same_bytes_other_seed_other_mesh() -> None:
    surface = make_box_with_hole()
    first, again, other = (remesh(surface, RemeshParameters(faces=800, seed=s)) for s in (0, 0, 1))
    assert first.vertices.tobytes() == again.vertices.tobytes()
    assert first.faces.tobytes() == again.faces.tobytes()
    assert first.vertices.tobytes() != other.vertices.tobytes()


def test_renumbering_changes_nothing() -> None:
    surface = make_box_with_hole()
    result = remesh(surface, RemeshParameters(faces=800))
    renumbered = remesh(renumber(surface, 3), RemeshParameters(faces=800))
    assert np.array_equal(result.faces, renumbered.faces)
    np.testing.assert_allclose(renumbered.vertices, result.vertices, atol=1e-12)


def test_moving_and_scaling_change_last_digits_only() -> None:
    surface = make_box_with_hole()
    result = remesh(surface, RemeshParameters(faces=800))
    moved = replace(surface, vertices=3.7 * surface.vertices + [5.0, -2.0, 11.0])
    other = remesh(moved, RemeshParameters(faces=800))
    assert np.array_equal(result.faces, other.faces)
    np.testing.assert_allclose(other.vertices, 3.7 * result.vertices + [5.0, -2.0, 11.0], atol=1e-8)


def test_long_thin_shapes_are_refused_by_the_edge_length_that_fits() -> None:
    needle = make_surface(np.array([[0, 0, 0], [1e6, 0, 0], [0, 1e-3, 0]], np.float64), np.array([[0, 1, 2]]))
    with pytest.raises(LimitError) as caught:
        remesh(needle, RemeshParameters(faces=10_000, face_limit=1_000_000))
    assert caught.value.exit_code == 5
    assert "long or longer" in caught.value.line()


def test_a_shape_that_needs_more_faces_says_so() -> None:
    piece = make_tetrahedron()
    vertices = np.concatenate([piece.vertices + np.array([3.0 * i, 0, 0]) for i in range(20)])
    faces = np.concatenate([piece.faces + i * len(piece.vertices) for i in range(20)])
    result = remesh(make_surface(vertices, faces), RemeshParameters(faces=20))
    assert len(result.faces) == 80
    assert [note.code for note in result.notes] == ["W-FACES"]


def test_loops_that_touch_at_a_vertex_are_kept() -> None:
    plate = make_grid(10)
    centre = plate.vertices[plate.faces].mean(axis=1)
    x, y = np.floor(5 * centre[:, 0]), np.floor(5 * centre[:, 1])
    inside = ((x == 1) & (y == 1)) | ((x == 2) & (y == 2))
    plate = replace(plate, face_group=inside.astype(np.int32), groups=("body", "trim"))
    result = remesh(plate, RemeshParameters(faces=1000))
    assert abs(len(result.faces) / 1000 - 1) <= 0.02
    assert result.face_areas()[result.face_group == 1].sum() == pytest.approx(0.08, abs=1e-9)


def test_degenerate_faces_of_the_input_are_removed() -> None:
    grid = make_grid(40)
    vertices = grid.vertices.copy()
    strip = np.abs(vertices[:, 0] - 0.5) < 0.04
    vertices[strip, 0] = 0.5 + 1e-5 * vertices[strip, 0]
    pressed = replace(grid, vertices=vertices)
    assert np.sum(smallest_angles(pressed) < 0.1) > 50
    result = remesh(pressed, RemeshParameters(faces=1000))
    assert find_topology_defects(result.faces) == []
    assert np.all(face_normals(result.vertices, result.faces)[:, 2] > 0)
    assert smallest_angles(result).min() >= 10


@given(st.integers(0, 2**32 - 1), st.integers(20, 400))
@settings(max_examples=15, deadline=None, derandomize=True)
def test_random_shapes_stay_valid(seed: int, faces: int) -> None:
    random = np.random.default_rng(seed)
    surface = _random_shape(random)
    result = remesh(surface, RemeshParameters(faces=faces, seed=seed, iterations=6))
    assert find_topology_defects(result.faces) == []
    assert euler_number(result) == euler_number(surface)
    assert np.all(np.isfinite(result.vertices))
    assert np.all(result.face_areas() > 0)


def _random_shape(random: np.random.Generator) -> Surface:
    """A closed or open shape, stretched, sheared and dented at random."""
    shapes = [make_cube(), make_box_with_hole(16), make_grid(6), make_annulus(), make_octahedron()]
    surface = shapes[random.integers(len(shapes))]
    vertices = surface.vertices + random.normal(0, 0.03, surface.vertices.shape)
    vertices = vertices @ (np.eye(3) + random.normal(0, 0.3, (3, 3)))
    return replace(surface, vertices=vertices * 10.0 ** random.uniform(-2, 2, 3))


def test_features_of_a_cube() -> None:
    cube = make_cube()
    features = find_features(
        cube.vertices, cube.faces, make_twins(cube.faces), cube.face_group, np.radians(30), 0.1
    )
    assert len(features.first) == 12
    assert np.sum(features.vertex_chain <= -2) == 8
    assert np.sum(features.crease >= 0) == 24
    assert not features.kept.any()


def test_compacting_drops_what_is_gone() -> None:
    cube = make_cube()
    features = find_features(
        cube.vertices, cube.faces, make_twins(cube.faces), cube.face_group, np.radians(30), 0.1
    )
    mesh = remesh_module.make_editable_mesh(
        cube.vertices, cube.faces, features.crease, features.vertex_chain, features.vertex_arc
    )
    packed = compact(remesh_module.reserve(mesh, 5))
    assert np.array_equal(packed.tail, mesh.tail)
    assert np.array_equal(packed.twin, mesh.twin)
    assert len(packed.half_edge) == 8


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    ["cad_gear.stl", "cad_barrel.stl", "cad_signplate.stl", "os_spot.obj", "aki_bunny2.obj", "os_hammer.obj"],
)
def test_real_meshes(name: str, meshes_folder: Path) -> None:
    surface = read_surface(meshes_folder / name)
    result = remesh(surface, RemeshParameters(faces=10_000))
    edges = find_edges(result.faces)
    length = edge_lengths(result, edges)
    creased = np.mean(bends(result, edges) > np.radians(30)) > 0.05
    angle = smallest_angles(result)
    assert find_topology_defects(result.faces) == []
    assert euler_number(result) == euler_number(surface)
    assert abs(len(result.faces) / 10_000 - 1) <= 0.02
    assert length.std() / length.mean() <= (0.15 if creased else 0.12)
    assert np.median(angle) >= (52 if creased else 54)
    assert angle.min() >= 10
