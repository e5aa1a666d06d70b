"""How far the films of two snapshots are apart: vertex by vertex where they correspond, else as surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.closest import find_closest, make_closest_tree
from weathercoat.mesh.surface import Indices, Vectors, face_areas
from weathercoat.sim.snapshot import Snapshot

SAMPLES = 20_000  # points on each film from which distances are measured
Kind = Literal["same topology", "same mesh", "other mesh"]

# The additive recurrence of two dimensions with the lowest discrepancy known (Roberts, 2018).
_PLASTIC = 1.32471795724474602596


@dataclass(frozen=True)
class GeometryDifference:
    """How the films of two snapshots of one age differ; lengths in sizes, the square root of the metal's area
    in the first.

    kind: what they have in common, and so what could be compared.

    - "same topology", same faces and same cracks: positions_mean and positions_largest, the distances
      between corresponding vertices;
    - "same mesh" with other cracks: the same over the corners of the faces that both films still have (None
      where there is none), and broken_in_one: of the inner edges of the metal's mesh, the share along which
      one film is broken or lost and the other is whole;
    - "other mesh": distance_mean and distance_95, mean and 95th percentile of the distances from points of
      either film to the other, infinite where one film is lost altogether.
    """

    age: float
    kind: Kind
    positions_mean: float | None = None
    positions_largest: float | None = None
    broken_in_one: float | None = None
    distance_mean: float | None = None
    distance_95: float | None = None

    @property
    def is_none(self) -> bool:
        """Whether there is no difference at all."""
        return self.kind == "same topology" and self.positions_largest == 0.0

    @property
    def largest(self) -> float:
        """The mean distance, of whichever kind."""
        return max(self.positions_mean or 0.0, self.distance_mean or 0.0)


def compare_snapshots(a: Snapshot, b: Snapshot) -> GeometryDifference:
    """How the films of two snapshots differ."""
    size = float(np.sqrt(face_areas(a.substrate_vertices, a.substrate_faces).sum()))
    if not np.array_equal(a.substrate_faces, b.substrate_faces):
        mean, most = _surface_distance(a, b, size)
        return GeometryDifference(a.age, "other mesh", distance_mean=mean, distance_95=most)
    is_same = np.array_equal(a.film_face, b.film_face) and np.array_equal(a.film_faces, b.film_faces)
    if is_same:
        gap = np.linalg.norm(a.film_vertices - b.film_vertices, axis=1) / size
    else:
        gap = _corner_distances(a, b) / size
    return GeometryDifference(
        a.age,
        "same topology" if is_same else "same mesh",
        positions_mean=float(gap.mean()) if gap.size else (0.0 if is_same else None),
        positions_largest=float(gap.max()) if gap.size else (0.0 if is_same else None),
        broken_in_one=0.0 if is_same else _broken_in_one(a, b),
    )


def describe(found: GeometryDifference) -> str:
    """A geometry difference in words."""
    words = f"age {found.age:.3g}, {found.kind}: "
    if found.kind == "other mesh":
        return words + f"distance mean {found.distance_mean:.3g}, 95 % within {found.distance_95:.3g} sizes"
    if found.positions_mean is None:
        words += "no face is left in both"
    else:
        words += f"positions mean {found.positions_mean:.3g}, largest {found.positions_largest:.3g} sizes"
    if found.kind == "same mesh":
        words += f"; {100.0 * (found.broken_in_one or 0.0):.1f} % of edges broken in one only"
    return words


def _corner_distances(a: Snapshot, b: Snapshot) -> Vectors:
    """Distances (k,) between the corners of the faces that both films have."""
    _, in_a, in_b = np.intersect1d(a.film_face, b.film_face, assume_unique=True, return_indices=True)
    gap = a.film_vertices[a.film_faces[in_a]] - b.film_vertices[b.film_faces[in_b]]
    return np.linalg.norm(gap, axis=2).ravel()


def _broken_in_one(a: Snapshot, b: Snapshot) -> float:
    """Share of the inner edges that are whole in one film and not in the other."""
    half_edge, twin = _inner_edges(a.substrate_faces, len(a.substrate_vertices))
    if not len(half_edge):
        return 0.0
    whole = [_are_whole(snapshot, half_edge, twin) for snapshot in (a, b)]
    return float(np.count_nonzero(whole[0] != whole[1]) / len(half_edge))


def _inner_edges(faces: Indices, vertex_count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The two half-edges of each edge between two faces; half-edge 3 f + i starts at corner i of face f."""
    tail, head = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    forward, backward = tail * vertex_count + head, head * vertex_count + tail
    order = np.argsort(forward, kind="stable")
    place = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    twin = order[place]
    has_twin = (forward[twin] == backward) & (tail < head)
    return np.flatnonzero(has_twin), twin[has_twin]


def _are_whole(
    snapshot: Snapshot, half_edge: NDArray[np.int64], twin: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether there is film on both sides of each edge, and it hangs together."""
    corner = np.full((len(snapshot.substrate_faces), 3), -1, np.int64)
    corner[snapshot.film_face] = snapshot.film_faces
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    is_joined = (start[half_edge] == end[twin]) & (end[half_edge] == start[twin])
    return is_joined & (start[half_edge] >= 0)  # type: ignore[no-any-return]


def _surface_distance(a: Snapshot, b: Snapshot, size: float) -> tuple[float, float]:
    """Mean and 95th percentile of the distances of either film's points from the other film."""
    if not len(a.film_faces) or not len(b.film_faces):
        both_lost = len(a.film_faces) == len(b.film_faces)
        return (0.0, 0.0) if both_lost else (np.inf, np.inf)
    distances = np.concatenate([_distances(*pair) for pair in ((a, b), (b, a))]) / size
    return float(distances.mean()), float(np.quantile(distances, 0.95))


def _distances(a: Snapshot, b: Snapshot) -> Vectors:
    """Distances (SAMPLES,) of points of the film of `a` from that of `b`."""
    points = sample_surface(a.film_vertices, a.film_faces, SAMPLES)
    tree = make_closest_tree(b.film_vertices, b.film_faces)
    _, near = find_closest(tree, points, np.zeros(len(points), np.int32))
    return np.linalg.norm(near - points, axis=1)  # type: ignore[no-any-return]


def sample_surface(vertices: Vectors, faces: Indices, count: int) -> Vectors:
    """Points (count, 3) that share a surface's area evenly: always the same for the same surface.

    The area is cut, in the order of the faces, into `count` equal parts with one point each, in a face that
    the middle of the part falls into.
    """
    reach = np.cumsum(face_areas(vertices, faces))
    wanted = (np.arange(count) + 0.5) / count * reach[-1]
    face = np.minimum(np.searchsorted(reach, wanted), len(faces) - 1)
    number = np.arange(1, count + 1)
    u, v = number / _PLASTIC % 1.0, number / _PLASTIC**2 % 1.0
    is_beyond = u + v > 1.0
    u, v = np.where(is_beyond, 1.0 - u, u), np.where(is_beyond, 1.0 - v, v)
    corner = vertices[faces[face]]
    along = u[:, None] * (corner[:, 1] - corner[:, 0]) + v[:, None] * (corner[:, 2] - corner[:, 0])
    return corner[:, 0] + along  # type: ignore[no-any-return]
