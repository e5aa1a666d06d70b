"""A zoo of small meshes whose every vertex and edge a test can name.

All lie in the plane z = 0 with their outside towards +z unless said otherwise, and have edges of about unit
length.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from weathercoat.mesh.halfedge import HalfEdgeMesh, make_half_edges
from weathercoat.mesh.surface import Indices, Surface, Vectors, make_surface

HALF_ROOT_3 = float(np.sqrt(3.0) / 2.0)


def make_triangle() -> Surface:
    """One equilateral face: every edge is a rim."""
    return _surface([(0, 0, 0), (1, 0, 0), (0.5, HALF_ROOT_3, 0)], [(0, 1, 2)])


def make_hinge(bend: float = 0.0) -> Surface:
    """Two equilateral faces on the edge 0-1, corners as drawn in `mesh.dihedral` (2 is p3, 3 is p4), bent by
    `bend`.

    The face with p4 is turned about the edge: down, away from the outside, for a positive bend.
    """
    p4 = (0.5, -HALF_ROOT_3 * np.cos(bend), -HALF_ROOT_3 * np.sin(bend))
    return _surface([(0, 0, 0), (1, 0, 0), (0.5, HALF_ROOT_3, 0), p4], [(0, 1, 2), (1, 0, 3)])


def make_tetrahedron() -> Surface:
    """Closed, outside outwards: every edge a ridge."""
    corners = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    return _surface(corners, [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def make_octahedron() -> Surface:
    """Closed, every vertex of valence four; vertex 4 is the top (+z), 5 the bottom."""
    corners = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    sides = [(i, (i + 1) % 4) for i in range(4)]
    return _surface(corners, [(a, b, 4) for a, b in sides] + [(b, a, 5) for a, b in sides])


def make_disc(spokes: int = 6) -> Surface:
    """A full fan round vertex 0; vertices 1 to `spokes` are its rim, counter-clockwise from +x."""
    turn = 2 * np.pi * np.arange(spokes) / spokes
    rim = np.stack([np.cos(turn), np.sin(turn), np.zeros(spokes)], axis=1)
    faces = [(0, i + 1, (i + 1) % spokes + 1) for i in range(spokes)]
    return _surface([(0, 0, 0), *rim], faces)


def make_fan(count: int = 3) -> Surface:
    """An open fan of equilateral faces round vertex 0, at most five: vertex 0 is on the rim."""
    turn = np.pi / 3 * np.arange(count + 1)
    rim = np.stack([np.cos(turn), np.sin(turn), np.zeros(count + 1)], axis=1)
    return _surface([(0, 0, 0), *rim], [(0, i + 1, i + 2) for i in range(count)])


def make_hexagon(rings: int = 2) -> Surface:
    """A hexagonal patch of the equilateral lattice, 6 rings**2 faces; vertex 0 is its centre."""
    points = [(0.0, 0.0)]
    corners = [(np.cos(np.pi / 3 * k), np.sin(np.pi / 3 * k)) for k in range(6)]
    for ring in range(1, rings + 1):
        for k in range(6):
            a, b = np.array(corners[k]) * ring, np.array(corners[(k + 1) % 6]) * ring
            points += [tuple(a + (b - a) * step / ring) for step in range(ring)]
    return _lattice_surface(np.array(points))


def make_lattice(columns: int, rows: int) -> Surface:
    """A parallelogram of the lattice; vertex j (columns + 1) + i is i along +x, j at 60 degrees."""
    corner = [(i + 0.5 * j, HALF_ROOT_3 * j, 0.0) for j in range(rows + 1) for i in range(columns + 1)]
    return _surface(corner, _grid_faces(columns, rows))


def make_ladder(rungs: int, *, length: float = 1.0, width: float = 1.0) -> Surface:
    """A strip of `rungs` - 1 rectangles along +x, each cut by a diagonal; rung i has the vertices 2 i (y =
    0), 2 i + 1.

    All vertices are on the rim; the inner edges are the rungs and the diagonals from 2 i to 2 i + 3.
    """
    corner = [(i * length, y, 0.0) for i in range(rungs) for y in (0.0, width)]
    faces = []
    for a in range(0, 2 * rungs - 2, 2):
        faces += [(a, a + 2, a + 3), (a, a + 3, a + 1)]
    return _surface(corner, faces)


def make_annulus(segments: int = 8) -> Surface:
    """A flat ring of two circles of `segments` vertices: the inner ones first."""
    turn = 2 * np.pi * np.arange(segments) / segments
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(segments)], axis=1)
    faces = []
    for i in range(segments):
        j = (i + 1) % segments
        faces += [(i, i + segments, j + segments), (i, j + segments, j)]
    return _surface([*circle, *(2 * circle)], faces)


def make_two_pieces() -> Surface:
    """A disc and, three units above it along y, a triangle that shares nothing with it."""
    disc, triangle = make_disc(), make_triangle()
    vertices = np.concatenate([disc.vertices, triangle.vertices + np.array([0.0, 3.0, 0.0])])
    return make_surface(vertices, np.concatenate([disc.faces, triangle.faces + len(disc.vertices)]))


def make_roof(bend: float = 0.8, rows: int = 4) -> Surface:
    """Two lattice planes that meet in a straight ridge of `rows` edges along y; a valley where negative."""
    columns = np.array([-1.0, 0.0, 1.0])
    corner = [
        (x * np.cos(bend / 2), HALF_ROOT_3 * j, -abs(x) * np.sin(bend / 2))
        for j in range(rows + 1)
        for x in columns
    ]
    return _surface(corner, _grid_faces(2, rows))


ZOO: dict[str, Callable[[], Surface]] = {
    "triangle": make_triangle,
    "hinge": make_hinge,
    "tetrahedron": make_tetrahedron,
    "octahedron": make_octahedron,
    "disc": make_disc,
    "fan": make_fan,
    "hexagon": make_hexagon,
    "lattice": lambda: make_lattice(4, 3),
    "ladder": lambda: make_ladder(5),
    "annulus": make_annulus,
    "two pieces": make_two_pieces,
    "roof": make_roof,
}


def make_mesh(surface: Surface) -> HalfEdgeMesh:
    """The half-edge structure of a zoo mesh as it is: its unit of length stands for the size."""
    return make_half_edges(surface.vertices, surface.faces)


def find_half_edge(mesh: HalfEdgeMesh, a: int, b: int) -> int:
    """The half-edge from vertex a to vertex b of a mesh."""
    head = mesh.tail.reshape(-1, 3)[:, [1, 2, 0]].reshape(-1)
    (found,) = np.flatnonzero((mesh.tail == a) & (head == b) & np.repeat(mesh.alive, 3))
    return int(found)


def find_edge(mesh: HalfEdgeMesh, a: int, b: int) -> int:
    """The smaller half-edge of the inner edge between the rest vertices a and b."""
    faces = mesh.faces
    tail, head = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    return int(np.flatnonzero(((tail == a) & (head == b)) | ((tail == b) & (head == a)))[0])


def edge_ends(mesh: HalfEdgeMesh, half_edges: Indices) -> set[tuple[int, int]]:
    """The edges of these half-edges as pairs of rest vertices, the smaller first."""
    tail, head = mesh.faces.reshape(-1), mesh.faces[:, [1, 2, 0]].reshape(-1)
    return {(int(min(tail[h], head[h])), int(max(tail[h], head[h]))) for h in half_edges}


def broken_edges(mesh: HalfEdgeMesh, initial_twin: Indices) -> set[tuple[int, int]]:
    """The edges that had two faces at the start and have lost their twins, as pairs of rest vertices."""
    return edge_ends(mesh, np.flatnonzero((initial_twin >= 0) & (mesh.twin < 0)))


def vertex_at(surface: Surface, x: float, y: float) -> int:
    """The vertex at a place of the plane z = 0."""
    distance = np.hypot(surface.vertices[:, 0] - x, surface.vertices[:, 1] - y)
    assert distance.min() < 1e-9, "no vertex there"
    return int(distance.argmin())


def renumber(surface: Surface, seed: int) -> Surface:
    """The same surface with shuffled vertices and faces, and faces that begin with another corner."""
    random = np.random.default_rng(seed)
    order = random.permutation(len(surface.vertices))
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    corner = (random.integers(0, 3, len(surface.faces))[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(rank[surface.faces], corner, axis=1)[random.permutation(len(surface.faces))]
    return make_surface(surface.vertices[order], faces, up=surface.up)


def fans_by_vertex(mesh: HalfEdgeMesh) -> dict[int, int]:
    """For each vertex in use, into how many fans its live faces fall when only twins join them.

    Written without the mesh's own walks round a vertex, so that it can judge them.
    """
    fans = {}
    live = [f for f in range(len(mesh.alive)) if mesh.alive[f]]
    around: dict[int, list[int]] = {}
    for f in live:
        for v in mesh.tail[3 * f : 3 * f + 3]:
            around.setdefault(int(v), []).append(f)
    for v, faces in around.items():
        group = {f: f for f in faces}

        def root(f: int, group: dict[int, int] = group) -> int:
            while group[f] != f:
                f = group[f]
            return f

        for f in faces:
            for h in range(3 * f, 3 * f + 3):
                g = int(mesh.twin[h])
                ends = {int(mesh.tail[h]), int(mesh.tail[h - h % 3 + (h + 1) % 3])}
                if g >= 0 and v in ends and g // 3 in group:
                    group[root(f)] = root(g // 3)
        fans[v] = len({root(f) for f in faces})
    return fans


def _surface(vertices: object, faces: object) -> Surface:
    return make_surface(np.array(vertices, float), np.array(faces, np.int32))


def _grid_faces(columns: int, rows: int) -> list[tuple[int, int, int]]:
    faces = []
    for j in range(rows):
        for i in range(columns):
            a = j * (columns + 1) + i
            b, c, d = a + 1, a + columns + 1, a + columns + 2
            faces += [(a, b, c), (b, d, c)]
    return faces


def _lattice_surface(points: Vectors) -> Surface:
    """All unit triangles of a set of lattice points (n, 2)."""
    place = {(round(2 * x), round(y / HALF_ROOT_3)): i for i, (x, y) in enumerate(points)}
    faces = []
    for (i, j), a in place.items():
        right, above, before = place.get((i + 2, j)), place.get((i + 1, j + 1)), place.get((i - 1, j + 1))
        if right is not None and above is not None:
            faces.append((a, right, above))
        if above is not None and before is not None:
            faces.append((a, above, before))
    return _surface(np.column_stack([points, np.zeros(len(points))]), faces)
