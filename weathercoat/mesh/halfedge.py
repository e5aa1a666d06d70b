"""The half-edge structure of the film: what is stored, what stays true, and the operations that change it.

Half-edge h = 3 f + i runs from corner i to corner i + 1 of face f:

            apex                    next_of(h) = the half-edge after h in its face
           /    \\                   prev_of(h) = the one before
     prev /  f   \\ next             twin[h]     = the opposite half-edge, -1 where there is none
         /        \\                 tail[h]     = the vertex that h starts from
     tail ---h---> head             half_edge[v]= one half-edge that starts from v, -1 once v has no face

Invariants, checked by `check_half_edges`:
- twin is an involution between live faces, and twins run in opposite directions between the same two
  vertices;
- the live faces round a vertex form one fan (the film is a manifold), so no vertex is shared across a crack;
- where the fan is open, `half_edge` is its first half-edge counter-clockwise, the one without a twin;
- faces are never renumbered; a face that is gone is only marked in `alive`, and its twins are -1;
- vertices are never renumbered; a split appends one, which keeps the `origin` of its parent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.pairing import pair_half_edges
from weathercoat.mesh.surface import Indices, Vectors, vertex_normals


class HalfEdgeMesh(NamedTuple):
    """The film's topology and positions, with the rest surface that its vertices remember.

    A tuple of plain arrays, so that kernels take it as one argument and change the arrays in place.

    m faces, n0 rest vertices; arrays over vertices have the capacity 3 m, of which `used[0]` are in use.
    positions: float64 (3 m, 3) in units of the model's size; tail, twin: int32 (3 m,); half_edge, origin:
    int32 (3 m,); alive: bool (m,); rest_positions, rest_normals: float64 (n0, 3); faces: int32 (m, 3), at
    rest.
    """

    positions: Vectors
    tail: Indices
    twin: Indices
    half_edge: Indices
    origin: Indices
    alive: NDArray[np.bool_]
    used: NDArray[np.int64]
    rest_positions: Vectors
    rest_normals: Vectors
    faces: Indices

    @property
    def vertex_count(self) -> int:
        """Vertices in use, those without a face included."""
        return int(self.used[0])


class EventLog(NamedTuple):
    """What one step changed, in order: each room brings its own arrays up to date from it.

    splits: int32 (k, 2), the new vertex and its parent; breaks: int32 (k, 2), the two half-edges of a broken
    edge; falls: int32 (k,), faces that are gone. `counts` holds how many of each are in use.
    """

    splits: Indices
    breaks: Indices
    falls: Indices
    counts: NDArray[np.int64]

    def clear(self) -> None:
        """Forget all entries."""
        self.counts[:] = 0

    def split_entries(self) -> Indices:
        """The splits in use, (k, 2)."""
        return self.splits[: self.counts[0]]

    def break_entries(self) -> Indices:
        """The breaks in use, (k, 2)."""
        return self.breaks[: self.counts[1]]

    def fall_entries(self) -> Indices:
        """The fallen faces in use, (k,)."""
        return self.falls[: self.counts[2]]


def make_event_log(face_count: int) -> EventLog:
    """An empty log with room for every event that `face_count` faces can ever have."""
    return EventLog(
        splits=np.zeros((3 * face_count, 2), np.int32),
        breaks=np.zeros((3 * face_count // 2 + 1, 2), np.int32),
        falls=np.zeros(face_count, np.int32),
        counts=np.zeros(3, np.int64),
    )


def make_half_edges(vertices: Vectors, faces: Indices) -> HalfEdgeMesh:
    """The half-edge structure of a manifold, consistently oriented mesh: vertices (n, 3), faces (m, 3).

    Raises ValueError where an edge has more than two faces, two that run the same way, or a vertex has two
    fans.
    """
    face_count, vertex_count = len(faces), len(vertices)
    capacity = 3 * face_count
    tail = np.ascontiguousarray(faces, np.int32).reshape(-1).copy()
    twin = make_twins(faces)
    half_edge = np.full(capacity, -1, np.int32)
    first_half_edges(tail, twin, half_edge)
    positions = np.empty((capacity, 3))
    positions[:vertex_count] = vertices
    origin = np.empty(capacity, np.int32)
    origin[:vertex_count] = np.arange(vertex_count, dtype=np.int32)
    mesh = HalfEdgeMesh(
        positions=positions,
        tail=tail,
        twin=twin,
        half_edge=half_edge,
        origin=origin,
        alive=np.ones(face_count, np.bool_),
        used=np.array([vertex_count], np.int64),
        rest_positions=np.ascontiguousarray(vertices, np.float64).copy(),
        rest_normals=vertex_normals(vertices, faces),
        faces=np.ascontiguousarray(faces, np.int32).copy(),
    )
    problem = check_half_edges(mesh)
    if problem:
        raise ValueError(problem)
    return mesh


def make_twins(faces: Indices) -> Indices:
    """The opposite of each half-edge, int32 (3 m,), -1 at a boundary; faces (m, 3) must be a manifold.

    Raises ValueError where an edge has more than two faces or two that run the same way.
    """
    faces = np.ascontiguousarray(faces, np.int32)
    twin, beyond, alike = pair_half_edges(faces, int(faces.max(initial=-1)) + 1)
    if len(beyond):
        raise ValueError("an edge has more than two faces")
    if alike:
        raise ValueError("two faces run along an edge in the same direction")
    return twin  # type: ignore[no-any-return]


@kernel
def next_of(h: int) -> int:
    """The half-edge after h in its face."""
    return h - 2 if h % 3 == 2 else h + 1


@kernel
def prev_of(h: int) -> int:
    """The half-edge before h in its face; its tail is the apex opposite to h."""
    return h + 2 if h % 3 == 0 else h - 1


@kernel
def first_half_edges(tail: Indices, twin: Indices, half_edge: Indices) -> None:
    """For each vertex, a half-edge that starts from it: the first of its fan where the fan is open."""
    for h in range(len(tail)):
        if half_edge[tail[h]] < 0 or twin[h] < 0:
            half_edge[tail[h]] = h


@kernel
def is_closed(h: int, twin: Indices) -> bool:
    """Whether the fan round the tail of h goes all the way round."""
    g = h
    while True:
        g = twin[prev_of(g)]
        if g < 0:
            return False
        if g == h:
            return True


@kernel
def cut_edge(mesh: HalfEdgeMesh, log: EventLog, h: int) -> tuple[bool, bool]:
    """Part the two faces of the edge of h; returns whether the tail of h, and its head, became the tip of a
    crack.

    A vertex whose fan was closed stays one vertex, the tip. One whose fan was open now has two fans: the one
    that does not hold the cut half-edge that starts there gets a new vertex at the same place, appended to
    the log's splits.
    """
    g = mesh.twin[h]
    tip_tail = is_closed(h, mesh.twin)
    tip_head = is_closed(g, mesh.twin)
    mesh.twin[h] = -1
    mesh.twin[g] = -1
    log.breaks[log.counts[1], 0] = h
    log.breaks[log.counts[1], 1] = g
    log.counts[1] += 1
    update_fan(mesh, log, h, g, tip_tail)
    update_fan(mesh, log, g, h, tip_head)
    return tip_tail, tip_head


@kernel
def update_fan(mesh: HalfEdgeMesh, log: EventLog, leaving: int, arriving: int, is_tip: bool) -> None:
    """Bring the vertex from which `leaving` starts up to date, parted from its twin `arriving`."""
    vertex = mesh.tail[leaving]
    mesh.half_edge[vertex] = leaving
    if is_tip:
        return
    new = mesh.used[0]
    mesh.used[0] += 1
    log.splits[log.counts[0], 0] = new
    log.splits[log.counts[0], 1] = vertex
    log.counts[0] += 1
    mesh.origin[new] = mesh.origin[vertex]
    for axis in range(3):
        mesh.positions[new, axis] = mesh.positions[vertex, axis]
    g = next_of(arriving)
    mesh.tail[g] = new
    while mesh.twin[g] >= 0:
        g = next_of(mesh.twin[g])
        mesh.tail[g] = new
    mesh.half_edge[new] = g


@kernel
def drop_face(mesh: HalfEdgeMesh, log: EventLog, f: int) -> None:
    """Delete face f; every face across one of its edges must fall with it.

    Its vertices have one fan each, which falls whole, so they are left without a face.
    """
    mesh.alive[f] = False
    for h in range(3 * f, 3 * f + 3):
        mesh.half_edge[mesh.tail[h]] = -1
        mesh.twin[h] = -1
    log.falls[log.counts[2]] = f
    log.counts[2] += 1


def check_half_edges(mesh: HalfEdgeMesh) -> str:
    """The first invariant that does not hold, in words, or an empty string."""
    return _PROBLEMS[_find_problem(mesh.tail, mesh.twin, mesh.half_edge, mesh.alive, mesh.vertex_count)]


_PROBLEMS = (
    "",
    "an index is out of range",
    "a live half-edge has a twin that is gone",
    "twin is no involution",
    "twins do not run between the same vertices",
    "a vertex does not know a half-edge of its own",
    "a vertex has more than one fan, or its fan does not begin with its first half-edge",
)


@kernel
def _find_problem(
    tail: Indices, twin: Indices, half_edge: Indices, alive: NDArray[np.bool_], vertex_count: int
) -> int:
    """The place in `_PROBLEMS` of the first invariant that does not hold, 0 where all do."""
    live = 0
    gone = torn = apart = False
    for h in range(len(tail)):
        if alive[h // 3] and (twin[h] >= len(twin) or tail[h] >= vertex_count):
            return 1
    for h in range(len(tail)):
        if not alive[h // 3]:
            continue
        live += 1
        t = twin[h]
        if t >= 0:
            gone |= not alive[t // 3]
            torn |= twin[t] != h
            apart |= tail[t] != tail[next_of(h)]
    if gone or torn or apart:
        return 2 if gone else 3 if torn else 4
    is_used = np.zeros(vertex_count, np.bool_)
    for h in range(len(tail)):
        if not alive[h // 3]:
            continue
        v = tail[h]
        is_used[v] = True
        first = half_edge[v]
        if first < 0 or not alive[first // 3] or tail[first] != v:
            return 5
    # Every half-edge is met once by going counter-clockwise round each vertex from its first one.
    met = 0
    for v in range(vertex_count):
        if not is_used[v]:
            continue
        g = half_edge[v]
        while met <= live:
            met += 1
            g = twin[prev_of(g)]
            if g < 0 or g == half_edge[v]:
                break
    return 0 if met == live else 6
