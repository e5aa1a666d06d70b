"""The triangle mesh that remeshing edits: half-edges that are split, collapsed and flipped in place.

Half-edge h = 3 f + i runs along side i of face f, as in `halfedge`. New faces and vertices are appended; a
face that is gone has tail -1, a vertex that is gone has half_edge -1, and `compact` drops both. Features
(creases, boundaries and borders of groups) are edges with `crease` >= 0, the number of the chain that they
lie on, on both half-edges.

Invariants, after every operation:
- twin is an involution between live faces, and twins run in opposite directions between the same vertices;
- the live faces round a vertex form one fan, which `half_edge` begins where it is open;
- no two edges join the same two vertices, and every feature of the input still has its edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.buckets import order_rows
from weathercoat.mesh.halfedge import first_half_edges, make_twins, next_of, prev_of
from weathercoat.mesh.order import order_points
from weathercoat.mesh.surface import Indices, Vectors

FREE = -1
"""`chain` of a vertex on no feature. Corner k, which stays where it is, has `chain` -2 - k."""


class EditableMesh(NamedTuple):
    """Arrays with room to grow; `count` (2,) holds how many vertices and faces are in use.

    Over vertices: position (., 3); chain, FREE or the chain that the vertex lies on or its corner; arc, its
    arc length along that chain; half_edge. Over half-edges: tail, twin, crease. Over faces: source, a face
    of the input nearby on the same side of all features.
    """

    position: Vectors
    chain: Indices
    arc: Vectors
    half_edge: Indices
    tail: Indices
    twin: Indices
    crease: Indices
    source: Indices
    count: NDArray[np.int64]  # type: ignore[assignment]


def make_editable_mesh(
    vertices: Vectors, faces: Indices, crease: Indices, chain: Indices, arc: Vectors
) -> EditableMesh:
    """The mesh of vertices (n, 3) and faces (m, 3), with the features of `creases.Features`.

    Raises ValueError where the faces are no oriented manifold.
    """
    tail = np.ascontiguousarray(faces, np.int32).reshape(-1).copy()
    twin = make_twins(faces)
    half_edge = np.full(len(vertices), -1, np.int32)
    first_half_edges(tail, twin, half_edge)
    return EditableMesh(
        position=np.ascontiguousarray(vertices, np.float64).copy(),
        chain=chain.copy(),
        arc=arc.copy(),
        half_edge=half_edge,
        tail=tail,
        twin=twin,
        crease=crease.copy(),
        source=np.arange(len(faces), dtype=np.int32),
        count=np.array([len(vertices), len(faces)], np.int64),
    )


def reserve(mesh: EditableMesh, splits: int) -> EditableMesh:
    """The same mesh with room for at least that many splits."""
    vertex_room = int(mesh.count[0]) + splits
    face_room = int(mesh.count[1]) + 2 * splits
    if vertex_room <= len(mesh.half_edge) and face_room <= len(mesh.source):
        return mesh
    return mesh._replace(
        position=_grown(mesh.position, vertex_room, 0.0),
        chain=_grown(mesh.chain, vertex_room, FREE),
        arc=_grown(mesh.arc, vertex_room, 0.0),
        half_edge=_grown(mesh.half_edge, vertex_room, -1),
        tail=_grown(mesh.tail, 3 * face_room, -1),
        twin=_grown(mesh.twin, 3 * face_room, -1),
        crease=_grown(mesh.crease, 3 * face_room, -1),
        source=_grown(mesh.source, face_room, -1),
    )


def _grown(array: NDArray, length: int, fill: float) -> NDArray:
    extra = np.full((max(length - len(array), 0), *array.shape[1:]), fill, array.dtype)
    return np.concatenate([array, extra])


def compact(mesh: EditableMesh) -> EditableMesh:
    """The same mesh without what is gone and without room to spare; order is kept."""
    alive = np.flatnonzero(mesh.tail[0 : 3 * int(mesh.count[1]) : 3] >= 0)
    used = np.flatnonzero(mesh.half_edge[: int(mesh.count[0])] >= 0)
    return _renumbered(mesh, used, alive)


def order_along_curve(mesh: EditableMesh) -> EditableMesh:
    """The same compact mesh with vertices and faces along the Morton curve, neighbours near each other."""
    order = order_points(mesh.position)
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    smallest = rank[mesh.tail].reshape(-1, 3).min(axis=1, keepdims=True)
    return _renumbered(mesh, order, order_rows(smallest, len(order)))


def _renumbered(mesh: EditableMesh, used: NDArray[np.integer], alive: NDArray[np.integer]) -> EditableMesh:
    """The mesh of its vertices `used` and faces `alive`, in this order."""
    new_vertex = np.full(len(mesh.half_edge), -1, np.int32)
    new_vertex[used] = np.arange(len(used), dtype=np.int32)
    half_edges = (3 * alive[:, None].astype(np.int64) + np.arange(3)).reshape(-1)
    new_half_edge = np.full(len(mesh.tail) + 1, -1, np.int32)
    new_half_edge[half_edges] = np.arange(len(half_edges), dtype=np.int32)
    return EditableMesh(
        position=mesh.position[used],
        chain=mesh.chain[used],
        arc=mesh.arc[used],
        half_edge=new_half_edge[mesh.half_edge[used]],
        tail=new_vertex[mesh.tail[half_edges]],
        twin=new_half_edge[mesh.twin[half_edges]],
        crease=mesh.crease[half_edges],
        source=mesh.source[alive],
        count=np.array([len(used), len(alive)], np.int64),
    )


def drop_faces(mesh: EditableMesh, drop: NDArray[np.bool_]) -> EditableMesh:
    """The same mesh without the faces where `drop` (m,) is true, which are whole components."""
    tail, half_edge = mesh.tail.copy(), mesh.half_edge.copy()
    gone = np.repeat(drop, 3)
    half_edge[tail[: len(gone)][gone]] = -1
    tail[: len(gone)][gone] = -1
    return compact(mesh._replace(tail=tail, half_edge=half_edge))


def join_meshes(one: EditableMesh, other: EditableMesh) -> EditableMesh:
    """Both compact meshes side by side."""
    vertices, half_edges = len(one.half_edge), len(one.tail)
    return EditableMesh(
        position=np.concatenate([one.position, other.position]),
        chain=np.concatenate([one.chain, other.chain]),
        arc=np.concatenate([one.arc, other.arc]),
        half_edge=np.concatenate([one.half_edge, other.half_edge + np.int32(half_edges)]),
        tail=np.concatenate([one.tail, other.tail + np.int32(vertices)]),
        twin=np.concatenate(
            [one.twin, np.where(other.twin < 0, -1, other.twin + half_edges).astype(np.int32)]
        ),
        crease=np.concatenate([one.crease, other.crease]),
        source=np.concatenate([one.source, other.source]),
        count=one.count + other.count,
    )


@kernel
def split_edge(h: int, mesh: EditableMesh) -> int:
    r"""Put a new vertex on the edge of h and return it; the caller sets its position, chain and arc.

             c                      c
           /   \                  / | \
          /     \                /  |  \         h keeps the half of the edge at its tail;
         a --h-- b     -->      a --m-- b        the new faces take the half at its head
          \     /                \  |  /
           \   /                  \ | /
             d                      d
    """
    tail, twin, crease = mesh.tail, mesh.twin, mesh.crease
    m = mesh.count[0]
    mesh.count[0] += 1
    g = twin[h]
    b = tail[next_of(h)]
    k = _split_face(h, m, mesh)
    if g < 0:
        twin[k] = -1
    else:
        a = tail[h]
        k_other = _split_face(g, m, mesh)
        twin[h] = k_other
        twin[k_other] = h
        twin[k] = g
        twin[g] = k
        if mesh.half_edge[a] == next_of(g):
            mesh.half_edge[a] = next_of(k_other)
        crease[k_other] = crease[h]
    if mesh.half_edge[b] == next_of(h):
        mesh.half_edge[b] = next_of(k)
    mesh.half_edge[m] = k
    return m


@kernel
def _split_face(h: int, m: int, mesh: EditableMesh) -> int:
    """Cut the face of h from m, on h, to its apex; returns the half-edge of the new face that continues h."""
    tail, twin, crease = mesh.tail, mesh.twin, mesh.crease
    f = mesh.count[1]
    mesh.count[1] += 1
    n = next_of(h)
    k = 3 * f
    tail[k] = m
    tail[k + 1] = tail[n]
    tail[k + 2] = tail[prev_of(h)]
    outer = twin[n]
    twin[k + 1] = outer
    if outer >= 0:
        twin[outer] = k + 1
    crease[k] = crease[h]
    crease[k + 1] = crease[n]
    tail[n] = m
    twin[n] = k + 2
    twin[k + 2] = n
    crease[n] = -1
    crease[k + 2] = -1
    mesh.source[f] = mesh.source[h // 3]
    return k


@kernel
def flip_edge(h: int, mesh: EditableMesh) -> None:
    r"""Turn the inner edge of h, which runs from a to b, into one from the far apex d to its own apex c.

             c                      c
           /   \                  / | \
          /  f  \                / f|  \
         a --h-- b     -->      a   |   b
          \  e  /                \  |e /
           \   /                  \ | /
             d                      d
    """
    tail, twin, crease = mesh.tail, mesh.twin, mesh.crease
    g = twin[h]
    hn, hp, gn, gp = next_of(h), prev_of(h), next_of(g), prev_of(g)
    a, b, c, d = tail[h], tail[g], tail[hp], tail[gp]
    outer_hn, outer_hp, outer_gn, outer_gp = twin[hn], twin[hp], twin[gn], twin[gp]
    crease_hn, crease_hp, crease_gn, crease_gp = crease[hn], crease[hp], crease[gn], crease[gp]
    tail[h], tail[hn], tail[hp] = d, c, a
    tail[g], tail[gn], tail[gp] = c, d, b
    _pair(hn, outer_hp, crease_hp, mesh)
    _pair(hp, outer_gn, crease_gn, mesh)
    _pair(gn, outer_gp, crease_gp, mesh)
    _pair(gp, outer_hn, crease_hn, mesh)
    start = mesh.half_edge
    if start[a] == h or start[a] == gn:
        start[a] = hp
    if start[b] == g or start[b] == hn:
        start[b] = gp
    if start[c] == hp:
        start[c] = hn
    if start[d] == gp:
        start[d] = gn


@kernel
def _pair(h: int, outer: int, chain: int, mesh: EditableMesh) -> None:
    """Make h and outer (or nothing, -1) each other's twin."""
    mesh.twin[h] = outer
    mesh.crease[h] = chain
    if outer >= 0:
        mesh.twin[outer] = h


@kernel
def collapse_edge(h: int, mesh: EditableMesh) -> None:
    """Remove the tail of h and the faces of its edge; the head takes over the tail's other faces.

    The caller has made sure by `edits.keeps_topology` that the mesh stays a manifold.
    """
    tail, twin = mesh.tail, mesh.twin
    g = twin[h]
    a, b = tail[h], tail[next_of(h)]
    k = mesh.half_edge[a]
    first = k
    while True:
        tail[k] = b
        k = twin[prev_of(k)]
        if k < 0 or k == first:
            break
    mesh.half_edge[a] = -1
    k = _zip_face(h, mesh)
    if g >= 0:
        k = _zip_face(g, mesh)
    first = k
    while twin[k] >= 0:
        k = next_of(twin[k])
        if k == first:
            break
    mesh.half_edge[b] = k


@kernel
def _zip_face(h: int, mesh: EditableMesh) -> int:
    """Remove the face of h, whose ends are one vertex now, and join its other sides; returns one of those."""
    tail, twin, crease = mesh.tail, mesh.twin, mesh.crease
    to_apex, from_apex = next_of(h), prev_of(h)
    apex = tail[from_apex]
    inward, outward = twin[to_apex], twin[from_apex]
    chain = max(crease[to_apex], crease[from_apex])
    if mesh.half_edge[apex] == from_apex:
        mesh.half_edge[apex] = inward
    if inward >= 0:
        _pair(inward, outward, chain, mesh)
    if outward >= 0:
        _pair(outward, inward, chain, mesh)
    for k in range(h - h % 3, h - h % 3 + 3):
        tail[k] = -1
        twin[k] = -1
    return outward if outward >= 0 else next_of(inward)
