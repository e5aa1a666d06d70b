"""What inspection tells, on shapes whose figures are known."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from weathercoat.mesh.inspect import inspect_surface, self_intersecting_faces
from weathercoat.mesh.materials import SourceMaterial, Texture
from weathercoat.mesh.surface import Part, Surface, make_surface


def grid(count: int) -> Surface:
    """The unit square as `count` by `count` squares of two triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    index = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([i.ravel() for i in t], axis=1) for t in ((a, b, c), (a, c, d))])
    return make_surface(vertices, faces.astype(np.int32))


def tetrahedron(offset: float = 0.0) -> Surface:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float) + offset
    return make_surface(vertices, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32))


def joined(one: Surface, other: Surface) -> Surface:
    return make_surface(
        np.vstack([one.vertices, other.vertices]), np.vstack([one.faces, other.faces + len(one.vertices)])
    )


def test_open_grid() -> None:
    facts = inspect_surface(grid(4))
    assert facts["faces"] == 32
    assert facts["vertices"] == 25
    assert facts["edges"] == 56
    assert facts["boundary_edges"] == 16
    assert facts["boundary_loops"] == 1
    assert facts["euler_number"] == 1
    assert facts["components"] == 1
    assert facts["manifold"]
    assert not facts["watertight"]
    assert facts["area"] == pytest.approx(1.0)
    assert facts["bounding_box"] == [[0, 0, 0], [1, 1, 0]]
    assert facts["edge_length"]["min"] == pytest.approx(0.25)
    assert facts["edge_length"]["max"] == pytest.approx(0.25 * np.sqrt(2))
    assert facts["sharp_edge_share"] == 0.0
    json.dumps(facts, allow_nan=False)


def test_closed_tetrahedron_has_sharp_edges_only() -> None:
    facts = inspect_surface(tetrahedron())
    assert facts["watertight"]
    assert facts["euler_number"] == 2
    assert facts["boundary_loops"] == 0
    assert facts["sharp_edge_share"] == 1.0


def test_groups_with_their_areas() -> None:
    surface = grid(2)
    group = (surface.vertices[surface.faces].mean(axis=1)[:, 0] > 0.5).astype(np.int32)
    facts = inspect_surface(
        make_surface(surface.vertices, surface.faces, face_group=group, groups=("left", "right"))
    )
    assert [entry["name"] for entry in facts["groups"]] == ["left", "right"]
    assert [entry["faces"] for entry in facts["groups"]] == [4, 4]
    assert [entry["area"] for entry in facts["groups"]] == pytest.approx([0.5, 0.5])


def test_what_is_no_manifold_is_said() -> None:
    fan = make_surface(
        np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], float),
        np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]], np.int32),
    )
    assert not inspect_surface(fan)["manifold"]


@pytest.mark.parametrize(("offset", "count"), [(0.1, 4), (0.3, 4), (0.34, 0), (5.0, 0)])
def test_corner_of_a_tetrahedron_pokes_through_another(offset: float, count: int) -> None:
    """While 3 offset < 1 the corner lies behind the face x + y + z = 1, and its edges pass through that."""
    surface = joined(tetrahedron(), tetrahedron(offset))
    assert self_intersecting_faces(surface.vertices, surface.faces).sum() == count
    notes = inspect_surface(surface, self_intersections=True)["notes"]
    assert sum(note["count"] for note in notes if note["code"] == "W-SELFINT") == count


def test_self_intersections_agree_with_all_pairs() -> None:
    """Random triangles, against the signs of volumes for every pair without the grid."""
    random = np.random.default_rng(6)
    corner = random.random((60, 1, 3)) + 0.3 * random.normal(size=(60, 3, 3))

    def volume(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
        return float(np.linalg.det(np.stack([b - a, c - a, d - a])))

    def pierces(a: np.ndarray, b: np.ndarray, t: np.ndarray) -> bool:
        if volume(*t, a) * volume(*t, b) >= 0:
            return False
        sides = [volume(a, b, t[k], t[(k + 1) % 3]) > 0 for k in range(3)]
        return len(set(sides)) == 1

    expected = np.zeros(60, bool)
    for i in range(60):
        for j in range(60):
            if i != j and any(pierces(corner[i, k], corner[i, (k + 1) % 3], corner[j]) for k in range(3)):
                expected[[i, j]] = True
    found = self_intersecting_faces(corner.reshape(-1, 3), np.arange(180, dtype=np.int32).reshape(-1, 3))
    assert 10 < expected.sum() < 60
    assert np.array_equal(found, expected)


def test_neighbours_and_flat_sheets_do_not_count() -> None:
    assert not self_intersecting_faces(grid(6).vertices, grid(6).faces).any()
    assert not self_intersecting_faces(tetrahedron().vertices, tetrahedron().faces).any()


def test_what_the_surface_carries_is_told() -> None:
    plain = grid(4)
    corner = plain.vertices[plain.faces]
    moved = corner[..., :2] + 2.0 * (corner[..., 0].mean(axis=1) > 0.5)[:, None, None]
    wood = SourceMaterial("wood", {}, (Texture(b"", "image/png"),))
    whole = np.zeros(len(plain.faces), np.int32)
    surface = dataclasses.replace(
        plain, uv=moved, materials=(wood,), parts=(Part("door", 0), Part("hinge", 0)), face_part=whole
    )
    facts = inspect_surface(surface)
    assert facts["texture"] == {"charts": 2, "seam_edges": 4, "seam_length": pytest.approx(1.0)}
    assert facts["materials"] == [{"name": "wood", "textures": 1, "has_base_texture": False}]
    assert facts["parts"] == [{"name": "door", "faces": 32}, {"name": "hinge", "faces": 0}]
    assert not facts["has_normals"]
    assert inspect_surface(plain)["texture"] is None
    json.dumps(facts, allow_nan=False)
