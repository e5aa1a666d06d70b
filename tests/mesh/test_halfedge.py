"""The half-edge structure: its invariants after every edit, judged by walks of the test's own."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import zoo
from tests.zoo import ZOO, find_half_edge, make_mesh
from weathercoat.mesh.halfedge import (
    HalfEdgeMesh,
    check_half_edges,
    cut_edge,
    drop_face,
    is_closed,
    make_event_log,
    make_half_edges,
    make_twins,
    next_of,
    prev_of,
)

ANIMALS = pytest.mark.parametrize("name", ZOO)


def assert_sound(mesh: HalfEdgeMesh) -> None:
    """The mesh's own check, and each vertex with one fan by the test's."""
    assert check_half_edges(mesh) == ""
    assert set(zoo.fans_by_vertex(mesh).values()) <= {1}


@ANIMALS
def test_zoo_is_sound(name: str) -> None:
    surface = ZOO[name]()
    mesh = make_mesh(surface)
    assert_sound(mesh)
    assert mesh.vertex_count == len(surface.vertices)
    assert (mesh.origin[: mesh.vertex_count] == np.arange(mesh.vertex_count)).all()
    assert (mesh.tail.reshape(-1, 3) == surface.faces).all()


@pytest.mark.parametrize(
    ("name", "euler", "boundary"),
    [
        ("triangle", 1, 3),
        ("tetrahedron", 2, 0),
        ("octahedron", 2, 0),
        ("disc", 1, 6),
        ("annulus", 0, 16),
        ("two pieces", 2, 9),
        ("ladder", 1, 10),
    ],
)
def test_twins_count_the_edges_of_known_shapes(name: str, euler: int, boundary: int) -> None:
    surface = ZOO[name]()
    twin = make_twins(surface.faces)
    open_edges = int((twin < 0).sum())
    assert open_edges == boundary
    edges = (len(twin) + open_edges) // 2
    assert len(surface.vertices) - edges + len(surface.faces) == euler


def test_next_and_prev_go_round_a_face() -> None:
    for h in range(12):
        assert next_of(h) // 3 == prev_of(h) // 3 == h // 3
        assert prev_of(next_of(h)) == next_of(prev_of(h)) == h
        assert next_of(next_of(h)) == prev_of(h)


@ANIMALS
def test_first_half_edge_opens_the_fan(name: str) -> None:
    mesh = make_mesh(ZOO[name]())
    rim = set(mesh.tail[mesh.twin < 0].tolist())
    for v in range(mesh.vertex_count):
        first = int(mesh.half_edge[v])
        assert mesh.tail[first] == v
        assert is_closed(first, mesh.twin) == (v not in rim)
        assert (mesh.twin[first] < 0) == (v in rim)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([(0, 1, 2), (1, 0, 3), (0, 1, 4)], "more than two faces"),
        ([(0, 1, 2), (0, 1, 3)], "same direction"),
        ([(0, 1, 2), (0, 3, 4)], "more than one fan"),
        # a Moebius strip of five faces: every edge has at most two, but no orientation fits
        ([(0, 1, 2), (1, 3, 2), (2, 3, 4), (3, 0, 4), (4, 0, 1)], "same direction"),
    ],
    ids=["three faces on an edge", "flipped face", "bow tie", "Moebius strip"],
)
def test_what_is_no_oriented_manifold_is_refused(faces: list[tuple[int, int, int]], message: str) -> None:
    vertices = np.random.default_rng(1).random((5, 3))
    with pytest.raises(ValueError, match=message):
        make_half_edges(vertices, np.array(faces, np.int32))


def test_check_names_each_corruption() -> None:
    mesh = make_mesh(zoo.make_disc())
    inner = find_half_edge(mesh, 0, 1)

    def corrupted(**change: tuple[int, int]) -> str:
        copy = HalfEdgeMesh(*(array.copy() for array in mesh))
        for name, (index, value) in change.items():
            getattr(copy, name)[index] = value
        return check_half_edges(copy)

    assert corrupted() == ""
    assert "involution" in corrupted(twin=(inner, find_half_edge(mesh, 0, 3)))
    assert "gone" in corrupted(alive=(0, False))
    assert "same vertices" in corrupted(tail=(inner, 4))
    assert "out of range" in corrupted(tail=(inner, 9))
    assert "half-edge of its own" in corrupted(half_edge=(0, find_half_edge(mesh, 1, 0)))
    # a fan that was cut in two places but not split
    copy = HalfEdgeMesh(*(array.copy() for array in mesh))
    for end in (1, 4):
        h = find_half_edge(copy, 0, end)
        copy.twin[[h, copy.twin[h]]] = -1
    assert "more than one fan" in check_half_edges(copy)


def test_cut_inside_makes_two_tips_and_no_vertex() -> None:
    surface = zoo.make_hexagon(2)
    mesh, log = make_mesh(surface), make_event_log(len(surface.faces))
    h = find_half_edge(mesh, 0, zoo.vertex_at(surface, 1, 0))
    g = int(mesh.twin[h])
    assert cut_edge(mesh, log, h) == (True, True)
    assert mesh.vertex_count == len(surface.vertices)
    assert mesh.twin[h] == mesh.twin[g] == -1
    assert log.break_entries().tolist() == [[h, g]] and len(log.split_entries()) == 0
    assert_sound(mesh)


def test_cut_from_rim_to_rim_splits_both_ends() -> None:
    mesh, log = make_mesh(zoo.make_hinge()), make_event_log(2)
    assert cut_edge(mesh, log, find_half_edge(mesh, 0, 1)) == (False, False)
    assert mesh.vertex_count == 6
    first, second = mesh.tail.reshape(-1, 3)
    assert not set(first) & set(second), "the two faces share a vertex across the cut"
    splits = log.split_entries()
    assert sorted(splits[:, 1].tolist()) == [0, 1] and sorted(splits[:, 0].tolist()) == [4, 5]
    for new, parent in splits:
        assert mesh.origin[new] == mesh.origin[parent] == parent
        assert (mesh.positions[new] == mesh.positions[parent]).all()
    assert_sound(mesh)


@pytest.mark.parametrize("order", list(permutations(range(1, 5)))[::3])
def test_centre_of_a_disc_has_one_vertex_for_each_cut_spoke(order: tuple[int, ...]) -> None:
    """k cut spokes leave k fans round the centre (one where none or one is cut); each rim end splits once."""
    mesh, log = make_mesh(zoo.make_disc(4)), make_event_log(4)
    for cuts, spoke in enumerate(order, start=1):
        (h,) = np.flatnonzero((mesh.faces.reshape(-1) == 0) & (mesh.faces[:, [1, 2, 0]].reshape(-1) == spoke))
        tip_centre, tip_rim = cut_edge(mesh, log, int(h))
        assert (tip_centre, tip_rim) == (cuts == 1, False)
        used = np.unique(mesh.tail)
        assert (mesh.origin[used] == 0).sum() == cuts
        assert (mesh.origin[used] == spoke).sum() == 2
        assert_sound(mesh)


@settings(max_examples=40, deadline=None)
@given(name=st.sampled_from(sorted(ZOO)), seed=st.integers(0, 2**32 - 1))
def test_cutting_every_edge_in_any_order_leaves_single_triangles(name: str, seed: int) -> None:
    """After each cut the structure is sound; after the last, each face has three vertices of its own."""
    surface = ZOO[name]()
    mesh, log = make_mesh(surface), make_event_log(len(surface.faces))
    inner = np.flatnonzero(mesh.twin > np.arange(len(mesh.twin)))
    for h in np.random.default_rng(seed).permutation(inner):
        before = mesh.vertex_count
        tips = cut_edge(mesh, log, int(h))
        assert mesh.vertex_count == before + 2 - sum(tips)
        assert_sound(mesh)
    assert mesh.vertex_count == 3 * len(surface.faces)
    assert sorted(mesh.tail) == list(range(3 * len(surface.faces)))
    assert len(log.break_entries()) == len(inner)
    corner = surface.faces.reshape(-1)
    assert (mesh.origin[mesh.tail] == corner).all(), "a corner stems from another vertex than at the start"
    assert (mesh.positions[mesh.tail] == surface.vertices[corner]).all()


def test_dropping_a_piece_leaves_the_rest_sound() -> None:
    surface = zoo.make_two_pieces()
    mesh, log = make_mesh(surface), make_event_log(len(surface.faces))
    for f in range(6):
        drop_face(mesh, log, f)
    assert log.fall_entries().tolist() == list(range(6))
    assert mesh.alive.tolist() == [False] * 6 + [True]
    assert (mesh.half_edge[:7] == -1).all() and (mesh.half_edge[7:10] >= 0).all()
    assert_sound(mesh)


def test_log_forgets() -> None:
    mesh, log = make_mesh(zoo.make_hinge()), make_event_log(2)
    cut_edge(mesh, log, find_half_edge(mesh, 0, 1))
    log.clear()
    assert len(log.split_entries()) == len(log.break_entries()) == len(log.fall_entries()) == 0
