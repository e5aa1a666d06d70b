"""Figures that tell one crack pattern from another, from the geometry of one snapshot.

The pattern is a graph on the metal: the edges along which two faces of the film came apart, and those between
film and lost film. Every figure is finite, whether there is a crack, or any film, or not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.mesh.surface import Vectors, face_areas
from weathercoat.output.cracks import find_openings, make_graph, rim_vertices
from weathercoat.sim.snapshot import Snapshot

PATTERN_FIGURES = (
    "junctions_three",
    "junctions_four",
    "straightness",
    "dead_ends",
    "crack_spacing",
    "pieces",
    "piece_median_area",
    "piece_roundness",
    "raised",
)
MOST_SPACING = 1.0  # sizes; what a film without cracks has


def measure_pattern(snapshot: Snapshot) -> dict[str, float]:
    """The figures of a snapshot; lengths in sizes (the square root of the metal's area), areas in their
    squares, all at rest.

    - junctions_three, junctions_four: vertices at which three, and more, edges of the pattern meet, a share
      of all its vertices; 0 without cracks;
    - straightness: mean cosine between one edge of a crack and the next, over vertices where just two
      meet: 1 for straight cracks; 0 where there are none;
    - dead_ends: vertices within the film at which a crack ends, by the pattern's length; 0 without cracks;
    - crack_spacing: four times the mean distance from the metal to the nearest crack, which for parallel
      cracks is how far they are apart; at most 1, which is also what a film without cracks has;
    - pieces: connected pieces of film; piece_median_area; piece_roundness: 4 π area over squared outline,
      the mean by area, at most 1 (which a disc has); 0 where no film is left;
    - raised: mean distance of the film from where it was at rest, by area; 0 where no film is left.
    """
    areas = face_areas(snapshot.substrate_vertices, snapshot.substrate_faces)
    size = float(np.sqrt(areas.sum()))
    openings = find_openings(snapshot)
    edges = openings.edges()
    return {
        **_graph_figures(edges, snapshot, size),
        "crack_spacing": _spacing(edges, snapshot, areas, size),
        **_piece_figures(openings.ends, openings.is_open(), snapshot, areas, size),
        "raised": _raised(snapshot, areas, size),
    }


def _graph_figures(edges: NDArray[np.int64], snapshot: Snapshot, size: float) -> dict[str, float]:
    """Degrees and directions of the pattern, whose edges (e, 2) are pairs of the metal's vertices."""
    if not len(edges):
        return {"junctions_three": 0.0, "junctions_four": 0.0, "straightness": 0.0, "dead_ends": 0.0}
    vertices = snapshot.substrate_vertices
    graph = make_graph(edges, vertices)
    degree, cosines = graph.degree, graph.straightness()
    on_pattern = np.count_nonzero(degree)
    is_rim = np.zeros(len(vertices), np.bool_)
    is_rim[rim_vertices(snapshot.substrate_faces)] = True
    total = 0.5 * float(graph.length.sum()) / size
    return {
        "junctions_three": float(np.count_nonzero(degree == 3) / on_pattern),
        "junctions_four": float(np.count_nonzero(degree > 3) / on_pattern),
        "straightness": float(cosines.mean()) if len(cosines) else 0.0,
        "dead_ends": float(np.count_nonzero((degree == 1) & ~is_rim) / total) if total > 0.0 else 0.0,
    }


def _spacing(edges: NDArray[np.int64], snapshot: Snapshot, areas: Vectors, size: float) -> float:
    """Four times the mean distance from the metal's faces to points of the cracks, in sizes."""
    if not len(edges):
        return MOST_SPACING
    from scipy.spatial import KDTree

    vertices = snapshot.substrate_vertices
    ends = vertices[edges]
    points = np.concatenate([vertices[np.unique(edges)], ends.mean(axis=1)])
    centers = vertices[snapshot.substrate_faces].mean(axis=1)
    distance, _ = KDTree(points).query(centers)
    return min(4.0 * float(np.average(distance, weights=areas)) / size, MOST_SPACING)


def _piece_figures(
    ends: NDArray[np.int64],
    is_open: NDArray[np.bool_],
    snapshot: Snapshot,
    areas: Vectors,
    size: float,
) -> dict[str, float]:
    """Number, areas and shapes of the pieces of film, which openings divide."""
    if not len(snapshot.film_faces):
        return {"pieces": 0.0, "piece_median_area": 0.0, "piece_roundness": 0.0}
    count, piece = _connect(ends, is_open, len(snapshot.substrate_vertices))
    has_twin = _has_twin(ends, len(snapshot.substrate_vertices))
    places = snapshot.substrate_vertices[ends]
    length = np.linalg.norm(places[:, 1] - places[:, 0], axis=1)
    is_outline = is_open | ~has_twin
    outline = np.bincount(np.repeat(piece, 3), np.where(is_outline, length, 0.0), minlength=count)
    area = np.bincount(piece, areas[snapshot.film_face], minlength=count)
    roundness = np.ones(count)
    has_outline = outline > 0.0  # a closed film without cracks has none
    roundness[has_outline] = 4.0 * np.pi * area[has_outline] / outline[has_outline] ** 2
    return {
        "pieces": float(count),
        "piece_median_area": float(np.median(area)) / size**2,
        "piece_roundness": float(np.average(np.minimum(roundness, 1.0), weights=area)),
    }


def _connect(
    ends: NDArray[np.int64], is_open: NDArray[np.bool_], vertex_count: int
) -> tuple[int, NDArray[np.int32]]:
    """The number of pieces, and for each face of the film the one that it belongs to."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    whole = np.flatnonzero(~is_open)
    low, high = ends[whole].min(axis=1), ends[whole].max(axis=1)
    key = low * vertex_count + high
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(np.diff(key[order]) == 0)
    pair = whole[order[same]] // 3, whole[order[same + 1]] // 3
    faces = len(ends) // 3
    count, piece = connected_components(coo_matrix((np.ones(len(same)), pair), (faces, faces)), False)
    return int(count), piece


def _has_twin(ends: NDArray[np.int64], vertex_count: int) -> NDArray[np.bool_]:
    """Whether the film has a face on the other side of each half-edge, be it in one piece with it or not."""
    forward = ends[:, 0] * vertex_count + ends[:, 1]
    return np.isin(ends[:, 1] * vertex_count + ends[:, 0], forward)


def _raised(snapshot: Snapshot, areas: Vectors, size: float) -> float:
    if not len(snapshot.film_faces):
        return 0.0
    here = snapshot.film_vertices[snapshot.film_faces].mean(axis=1)
    rest = snapshot.substrate_vertices[snapshot.substrate_faces[snapshot.film_face]].mean(axis=1)
    gap = np.linalg.norm(here - rest, axis=1)
    return float(np.average(gap, weights=areas[snapshot.film_face])) / size
