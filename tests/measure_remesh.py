"""Measure remeshed surfaces: `python -m tests.measure_remesh MESH... --faces 3000 10000`.

MESH is a file or one of the shapes made here: plate, grid, cube, box-hole. One row for each mesh and number
of faces:

faces, off        faces made, and their deviation from the target [%] cv                coefficient of
variation of the edge length; (creases) the share of edges that are creases [%] angle             smallest
angle of a triangle, median and worst [degrees] psi               largest |psi_2|, |psi_4|, |psi_6| over the
flat parts of 1,000 faces or more line              distance of the new creases above 30 degrees and
boundaries from those of the input / diagonal in>out, out>in    largest distance of sampled points of either
surface from the other / diagonal defects           flipped, degenerate, non-manifold faces; euler: the
change of the Euler number s                 CPU seconds of a second call
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.read import read_surface
from weathercoat.mesh.remesh import RemeshParameters, remesh
from weathercoat.mesh.surface import Surface, Vectors, face_normals, make_surface

_CREASE = np.radians(30.0)
_SAMPLES = 40_000


@dataclass(frozen=True)
class Edges:
    """Unique edges: ends (k, 2), two faces beside them (k, 2) or -1, and how many faces they have (k,)."""

    ends: NDArray[np.int64]
    faces: NDArray[np.int64]
    count: NDArray[np.int64]


def find_edges(faces: NDArray[np.int32]) -> Edges:
    """The edges of the faces (m, 3)."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    owner = np.tile(np.arange(len(faces)), 3)
    low, high = directed.min(axis=1), directed.max(axis=1)
    order = np.lexsort((owner, high, low))
    low, high, owner = low[order], high[order], owner[order]
    begins = np.ones(len(low), np.bool_)
    begins[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    first = np.flatnonzero(begins)
    count = np.diff(np.append(first, len(low)))
    second = np.where(count > 1, owner[np.minimum(first + 1, len(owner) - 1)], -1)
    return Edges(np.stack([low[first], high[first]], axis=1), np.stack([owner[first], second], axis=1), count)


def smallest_angles(surface: Surface) -> Vectors:
    """Smallest angle of each face [degrees], (m,)."""
    corner = surface.vertices[surface.faces]
    angles = []
    for i in range(3):
        a, b = corner[:, (i + 1) % 3] - corner[:, i], corner[:, (i + 2) % 3] - corner[:, i]
        angles.append(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)))
    return np.degrees(np.min(angles, axis=0))


def edge_lengths(surface: Surface, edges: Edges) -> Vectors:
    """Length of each edge (k,)."""
    return np.linalg.norm(surface.vertices[edges.ends[:, 0]] - surface.vertices[edges.ends[:, 1]], axis=1)


def bends(surface: Surface, edges: Edges) -> Vectors:
    """Angle between the normals of the two faces of each edge [rad]; π at a boundary."""
    normal = face_normals(surface.vertices, surface.faces)
    a, b = normal[edges.faces[:, 0]], normal[edges.faces[:, 1]]
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
    return np.where(edges.count == 1, np.pi, angle)


def euler_number(surface: Surface) -> int:
    """Vertices in use minus edges plus faces."""
    return len(np.unique(surface.faces)) - len(find_edges(surface.faces).ends) + len(surface.faces)


def find_topology_defects(faces: NDArray[np.int32]) -> list[str]:
    """What keeps the faces (m, 3) from being an oriented manifold, in words; empty where they are one."""
    found = []
    edges = find_edges(faces)
    if np.any((faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])):
        found.append("a face has a vertex twice")
    if np.any(edges.count > 2):
        found.append(f"{int(np.sum(edges.count > 2))} edges have more than two faces")
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    if len(np.unique(directed, axis=0)) != len(directed):
        found.append("two faces run along an edge in the same direction")
    if len(np.unique(np.sort(faces, axis=1), axis=0)) != len(faces):
        found.append("two faces have the same vertices")
    fans = _count_fans(faces, edges)
    if np.any(fans > 1):
        found.append(f"{int(np.sum(fans > 1))} vertices have more than one fan")
    return found


def _count_fans(faces: NDArray[np.int32], edges: Edges) -> NDArray[np.int64]:
    """Number of fans of faces round each vertex in use: corners joined across edges, counted."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    inner = edges.count >= 2
    left, right = [], []
    for end in range(2):
        vertex = edges.ends[inner, end]
        for side, corners in ((0, left), (1, right)):
            face = edges.faces[inner, side]
            corners.append(3 * face + np.argmax(faces[face] == vertex[:, None], axis=1))
    a, b = np.concatenate(left), np.concatenate(right)
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(faces.size, faces.size))
    fan = connected_components(graph, directed=False)[1]
    pairs = np.unique(np.stack([faces.reshape(-1).astype(np.int64), fan], axis=1), axis=0)
    return np.bincount(pairs[:, 0])


def count_bad_faces(surface: Surface, source: Surface) -> tuple[int, int]:
    """Faces that are flipped, and degenerate ones (under 0.1°).

    A flipped face opposes the input at its centre and at all its corners, so not mere detail below it.
    """
    import igl

    normal = face_normals(surface.vertices, surface.faces)
    below = face_normals(source.vertices, source.faces)
    points = [surface.vertices[surface.faces[:, i]] for i in range(3)]
    flipped = np.ones(len(surface.faces), np.bool_)
    for point in [sum(points) / 3, *points]:
        _, face, _ = igl.point_mesh_squared_distance(point, source.vertices, source.faces.astype(np.int64))
        flipped &= np.einsum("ij,ij->i", normal, below[face]) < 0
    return int(np.sum(flipped)), int(np.sum(smallest_angles(surface) < 0.1))


def flat_part_order(surface: Surface, least: int = 1000) -> tuple[float, float, float] | None:
    """Largest |ψ_2|, |ψ_4|, |ψ_6| over the flat parts of at least `least` faces; None where there is none."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = find_edges(surface.faces)
    joined = (edges.count == 2) & (bends(surface, edges) < 1e-5)
    a, b = edges.faces[joined].T
    count = len(surface.faces)
    part = connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(count, count)), directed=False)[1]
    worst = None
    for label in np.flatnonzero(np.bincount(part) >= least):
        inside = part[edges.faces[:, 0]] == label
        normal = face_normals(surface.vertices, surface.faces[part == label]).sum(axis=0)
        axes = np.linalg.svd(normal[None])[2][1:]
        step = surface.vertices[edges.ends[inside, 1]] - surface.vertices[edges.ends[inside, 0]]
        theta = np.arctan2(step @ axes[1], step @ axes[0])
        order = [abs(np.mean(np.exp(1j * m * theta))) for m in (2, 4, 6)]
        worst = order if worst is None else [max(pair) for pair in zip(worst, order, strict=True)]
    return None if worst is None else (worst[0], worst[1], worst[2])


def line_distance(surface: Surface, source: Surface) -> float:
    """Largest distance of the vertices on creases above 30° or boundaries from such lines of `source`."""
    import igl

    edges, lines = find_edges(surface.faces), find_edges(source.faces)
    on_line = np.unique(edges.ends[bends(surface, edges) > _CREASE])
    line = lines.ends[bends(source, lines) > _CREASE * (1 - 1e-9)]
    if len(on_line) == 0 or len(line) == 0:
        return 0.0
    points = np.ascontiguousarray(surface.vertices[on_line])
    squared, _, _ = igl.point_mesh_squared_distance(points, source.vertices, np.ascontiguousarray(line))
    return float(np.sqrt(squared.max()))


def sampled_distance(source: Surface, target: Surface) -> tuple[float, float]:
    """Root mean square and largest distance of random points of `source` from `target`."""
    import igl

    random = np.random.default_rng(0)
    area = source.face_areas()
    face = random.choice(len(area), _SAMPLES, p=area / area.sum())
    weight = random.dirichlet([1.0, 1.0, 1.0], _SAMPLES)
    points = np.einsum("ij,ijk->ik", weight, source.vertices[source.faces[face]])
    squared, _, _ = igl.point_mesh_squared_distance(points, target.vertices, target.faces.astype(np.int64))
    return float(np.sqrt(squared.mean())), float(np.sqrt(squared.max()))


def make_grid(columns: int) -> Surface:
    """The unit square as a regular grid."""
    x, y = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (g.ravel() for g in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    return make_surface(vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


def make_cube() -> Surface:
    """The unit cube in twelve triangles."""
    vertices = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return make_surface(vertices, np.array(faces))


def make_box_with_hole(segments: int = 48) -> Surface:
    """A box with a round hole through it, in few long triangles."""
    angle = 2 * np.pi * np.arange(segments) / segments
    circle = 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    square = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    square /= np.abs(square).max(axis=1, keepdims=True)
    rings = [(circle, 0.0), (square, 0.0), (square, 0.8), (circle, 0.8)]
    vertices = np.concatenate([np.column_stack([ring, np.full(segments, z)]) for ring, z in rings])
    here = np.arange(segments)
    ahead = (here + 1) % segments
    faces = []
    for i in range(4):
        low, high = i * segments, (i + 1) % 4 * segments
        faces += [np.stack([low + here, high + ahead, high + here], axis=1)]
        faces += [np.stack([low + here, low + ahead, high + ahead], axis=1)]
    return make_surface(vertices, np.concatenate(faces)[:, ::-1])


SHAPES = {
    "plate": lambda: make_grid(1),
    "grid": lambda: make_grid(50),
    "cube": make_cube,
    "box-hole": make_box_with_hole,
}


def measure(name: str, source: Surface, faces: int) -> str:
    """One row of the table."""
    remesh(source, RemeshParameters(faces=faces))
    start = time.process_time()
    result = remesh(source, RemeshParameters(faces=faces))
    seconds = time.process_time() - start
    edges = find_edges(result.faces)
    length = edge_lengths(result, edges)
    angle = smallest_angles(result)
    order = flat_part_order(result)
    diagonal = source.diagonal()
    flipped, degenerate = count_bad_faces(result, source)
    wrong = len(find_topology_defects(result.faces))
    creases = np.mean(bends(result, edges) > _CREASE)
    count = len(result.faces)
    return " ".join(
        [
            f"{name:22s}{faces:7d}{count:7d}{100 * (count / faces - 1):6.2f}",
            f"{length.std() / length.mean():6.3f} ({100 * creases:4.1f})",
            f"{np.median(angle):6.1f}{angle.min():6.1f}",
            "     -     -     -" if order is None else "".join(f"{x:6.3f}" for x in order),
            f"{line_distance(result, source) / diagonal:8.1e}",
            "".join(f"{x / diagonal:8.1e}" for x in sampled_distance(source, result)),
            "".join(f"{x / diagonal:8.1e}" for x in sampled_distance(result, source)),
            f"{flipped:3d}{degenerate:3d}{wrong:3d}",
            f"{euler_number(result) - euler_number(source):4d} {seconds:6.2f}",
        ]
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", nargs="+")
    parser.add_argument("--faces", nargs="+", type=int, default=[3000, 10_000])
    arguments = parser.parse_args()
    header = ("faces", "made", "off", "cv (creases)", "angle", "psi 2, 4, 6", "line", "in>out", "out>in")
    print("mesh", *header, "flipped degenerate non-manifold", "euler", "s", sep=" | ")
    for mesh in arguments.mesh:
        source = SHAPES[mesh]() if mesh in SHAPES else read_surface(mesh)
        for faces in arguments.faces:
            print(measure(Path(mesh).name, source, faces), flush=True)


if __name__ == "__main__":
    main()
