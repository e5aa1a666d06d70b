"""Flips that look only at edges whose surroundings changed, against passes over all edges."""

from __future__ import annotations

import numpy as np
import pytest

from tests import zoo
from weathercoat.mesh import shapes
from weathercoat.mesh.connectivity import EditableMesh, make_editable_mesh, order_along_curve, reserve
from weathercoat.mesh.creases import Features, find_features
from weathercoat.mesh.edits import (
    edge_lengths,
    face_count_at,
    flip_edges,
    flip_pass,
    mark_edges_about_new,
    split_pass,
    valence_excess,
)
from weathercoat.mesh.halfedge import make_twins
from weathercoat.mesh.surface import Surface, Vectors, face_normals

SURFACES = {
    "sphere": shapes.make_sphere(subdivisions=3),
    "plate": shapes.make_plate(columns=14, rows=11),
    "box": shapes.make_box(cells=5),
    "annulus": zoo.make_annulus(24),
}


def shaken(surface: Surface, seed: int) -> tuple[EditableMesh, Features, Vectors]:
    """A mesh with vertices out of place, and the normals of the faces as they were."""
    vertices, faces = surface.vertices, surface.faces
    normals = face_normals(vertices, faces)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    features = find_features(vertices, faces, make_twins(faces), surface.face_group, np.radians(30), 0.1)
    mesh = make_editable_mesh(vertices, faces, features.crease, features.vertex_chain, features.vertex_arc)
    span = edge_lengths(mesh).max()
    random = np.random.default_rng(seed)
    mesh.position[:] += 0.35 * span * random.uniform(-1, 1, mesh.position.shape)
    return mesh, features, normals


def flip_plainly(mesh: EditableMesh, normals: Vectors, passes: int, regularity: float) -> int:
    """All edges in every pass."""
    excess = valence_excess(mesh)
    done = 0
    for _ in range(passes):
        half_edges = 3 * int(mesh.count[1])
        is_due = np.ones(half_edges, np.bool_)
        flips = flip_pass(mesh, normals, excess, regularity, is_due, 0, half_edges)
        if flips == 0:
            break
        done += flips
    return done


def copy(mesh: EditableMesh) -> EditableMesh:
    return EditableMesh(*(array.copy() for array in mesh))


def assert_same(one: EditableMesh, other: EditableMesh) -> None:
    for name in EditableMesh._fields:
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("regularity", [0.0, 0.7])
@pytest.mark.parametrize("seed", range(4))
def test_passes_over_what_is_due_flip_the_same_edges(name: str, regularity: float, seed: int) -> None:
    mesh, _, normals = shaken(SURFACES[name], seed)
    plain = copy(mesh)
    done = flip_plainly(plain, normals, 10, regularity)
    flip_edges(mesh, normals, 10, regularity)
    assert done > 0
    assert_same(mesh, plain)


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("seed", range(4))
def test_splits_make_due_what_they_change(name: str, seed: int) -> None:
    """Rounds of splits and flips, in which all edges are due in the first round only."""
    mesh, features, normals = shaken(SURFACES[name], seed)
    plain = copy(mesh)
    random = np.random.default_rng(seed)
    is_due = np.ones(3 * int(mesh.count[1]), np.bool_)
    for _ in range(4):
        length = edge_lengths(mesh)
        chosen = random.permutation(np.flatnonzero(length > 0.7 * length.max()).astype(np.int32))
        ratios = random.uniform(0.3, 0.7, len(chosen))
        before = int(mesh.count[0])
        mesh, plain = reserve(mesh, len(chosen)), reserve(plain, len(chosen))
        for one in (mesh, plain):
            split_pass(chosen, ratios, 0.0, 0.0, one, features)
        is_due = np.concatenate([is_due, np.zeros(3 * int(mesh.count[1]) - len(is_due), np.bool_)])
        mark_edges_about_new(before, mesh, is_due)
        flip_edges(mesh, normals, 2, 0.0, is_due)
        flip_plainly(plain, normals, 2, 0.0)
        assert_same(mesh, plain)


@pytest.mark.parametrize("name", SURFACES)
def test_excess_of_valences(name: str) -> None:
    mesh, _, normals = shaken(SURFACES[name], 1)
    flip_edges(mesh, normals, 3)
    excess = valence_excess(mesh)
    for v in range(int(mesh.count[0])):
        count, closed = face_count_at(v, mesh)
        assert excess[v] == (count - 6 if closed else count - 3)


@pytest.mark.parametrize("name", SURFACES)
def test_ordering_keeps_the_mesh(name: str) -> None:
    """The same faces at the same places, with the same twins, chains and sources, near each other."""
    mesh, _, normals = shaken(SURFACES[name], 2)
    flip_edges(mesh, normals, 3)
    ordered = order_along_curve(mesh)
    assert (ordered.count == mesh.count).all()
    where = {tuple(p): v for v, p in enumerate(mesh.position.tolist())}
    old_vertex = np.array([where[tuple(p)] for p in ordered.position.tolist()])
    corner = mesh.tail.reshape(-1, 3).tolist()
    old_face = np.array([corner.index(old_vertex[face].tolist()) for face in ordered.tail.reshape(-1, 3)])
    old_half_edge = (3 * old_face[:, None] + np.arange(3)).ravel()
    assert (ordered.chain == mesh.chain[old_vertex]).all()
    assert (ordered.arc == mesh.arc[old_vertex]).all()
    assert (ordered.source == mesh.source[old_face]).all()
    assert (ordered.crease == mesh.crease[old_half_edge]).all()
    assert (old_half_edge[ordered.half_edge] == mesh.half_edge[old_vertex]).all()
    inner = ordered.twin >= 0
    assert (inner == (mesh.twin[old_half_edge] >= 0)).all()
    assert (old_half_edge[ordered.twin[inner]] == mesh.twin[old_half_edge][inner]).all()
    smallest = ordered.tail.reshape(-1, 3).min(axis=1)
    assert (np.diff(smallest) >= 0).all()
