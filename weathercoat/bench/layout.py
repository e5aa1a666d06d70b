"""The film of the benchmark: when each vertex lets go and which edges break is laid out beforehand.

The rules that then decide are the simulation's own. An adhesion that the drying tension overcomes at a given
age takes the place of the one by noise, whose order is kept, so that patches stay coherent. Weak edges are
laid along cracks: chains of edges that go on in about one direction, as cracks do, and never close a loop
nor reach the rim, so that no piece of film is cut out and the load does not fall off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.film.noise import hash_uniform, stream_key
from weathercoat.film.start import FilmLayout, lay_out_film, lift_at_rest
from weathercoat.film.state import FilmParameters, tension_at
from weathercoat.mesh.halfedge import HalfEdgeMesh, prev_of
from weathercoat.mesh.surface import Indices, Vectors

SEPARATED_SHARE = 0.6  # of the vertices at the end
BREAKS_PER_FACE = 0.2  # 2,000 broken edges on 10,000 faces at the end
_BANDS = 20  # equal spans of the run that get equal numbers of weak edges
_PASSES = 4  # what finds no room in its span is tried in the next ones
_SHORTEST, _LONGEST = 4, 20  # edges of a crack that meets nothing
_LARGEST = 20  # vertices of cracks that have met: longer ones all but cut out pieces, which then tear off


def lay_out_load(mesh: HalfEdgeMesh, parameters: FilmParameters, seed: int) -> FilmLayout:
    """A film of which equal numbers of vertices separate and of edges break in every step of one age."""
    p = parameters
    plain = lay_out_film(mesh, p, seed)
    release = np.empty(mesh.vertex_count)
    release[np.argsort(plain.adhesion, kind="stable")] = np.arange(mesh.vertex_count) + 0.5
    release /= SEPARATED_SHARE * mesh.vertex_count

    _, rest_lift = lift_at_rest(mesh, p)
    tension = np.array(
        [tension_at(p.tension_initial, 0.0, 1.0, p.tension_rate, True, age) for age in release]
    )
    adhesion = p.lift_coefficient * tension * rest_lift + p.adhesion_decay_rate * p.adhesion_base * release

    corner = mesh.rest_positions[mesh.faces].reshape(-1, 3)
    midpoint = 0.5 * (corner + np.roll(corner.reshape(-1, 3, 3), -1, axis=1).reshape(-1, 3))
    chance = hash_uniform(midpoint, stream_key(seed, "cracks"))
    quota = np.full(_BANDS, round(BREAKS_PER_FACE * len(mesh.faces)) // _BANDS)
    quota[: round(BREAKS_PER_FACE * len(mesh.faces)) % _BANDS] += 1
    weak = np.zeros(len(mesh.twin), np.bool_)
    order = np.argsort(chance, kind="stable").astype(np.int32)
    root = np.arange(mesh.vertex_count, dtype=np.int32)
    size = np.ones(mesh.vertex_count, np.int32)
    for _ in range(_PASSES):
        draw_cracks(mesh, release, order, chance, p.fracture_direction_threshold, quota, root, size, weak)
        quota = np.append(np.append(0, quota[:-2]), quota[-2:].sum())
    return FilmLayout(adhesion, np.where(weak, plain.cohesion * p.defects_strength, plain.cohesion))


@kernel
def draw_cracks(
    mesh: HalfEdgeMesh,
    release: Vectors,
    seeds: Indices,
    chance: Vectors,
    threshold: float,
    quota: NDArray[np.int64],
    root: Indices,
    size: Indices,
    weak: NDArray[np.bool_],
) -> None:
    """Mark in weak (3 m,) the half-edges of cracks that begin at `seeds`, in their order, and run both ways.

    release: (n0,), the age at which each vertex lets go. An edge can break once both its ends have; quota:
    for each of equal spans of one age the number of edges that can from then on. chance: (3 m,), a number in
    [0, 1) for each half-edge, the same for both of a pair. root, size: (n0,), for each vertex its own number
    and 1. Changes quota, root and size.
    """
    for h in range(len(mesh.twin)):
        if mesh.twin[h] < 0:  # no crack reaches the rim
            size[mesh.tail[h]] = _LARGEST
    for seed in seeds:
        g = mesh.twin[seed]
        if g < seed or not _is_usable(mesh, seed, release, quota, root, size):
            continue
        _take(mesh, seed, release, quota, root, size, weak)
        reach = _SHORTEST + int((_LONGEST - _SHORTEST) * ((chance[seed] * 1e6) % 1.0))
        for side in range(2):
            h = seed if side == 0 else g
            for _ in range(reach // 2):
                h = _next_edge(mesh, h, release, chance, threshold, quota, root, size)
                if h < 0:
                    break
                _take(mesh, h, release, quota, root, size, weak)


@kernel
def find_root(root: Indices, v: int) -> int:
    """The representative of the vertices that cracks join to v; shortens the way to it."""
    while root[v] != v:
        root[v] = root[root[v]]
        v = root[v]
    return v


@kernel
def _band(mesh: HalfEdgeMesh, h: int, release: Vectors, bands: int) -> int:
    """The span of time in which both ends of an edge have let go; `bands` or more for never."""
    return int(bands * max(release[mesh.tail[h]], release[mesh.tail[mesh.twin[h]]]))


@kernel
def _is_usable(
    mesh: HalfEdgeMesh, h: int, release: Vectors, quota: NDArray[np.int64], root: Indices, size: Indices
) -> bool:
    """Whether there is room for the edge of h and it closes no loop and joins no large cracks."""
    band = _band(mesh, h, release, len(quota))
    if band >= len(quota) or quota[band] == 0:
        return False
    a, b = find_root(root, mesh.tail[h]), find_root(root, mesh.tail[mesh.twin[h]])
    return a != b and size[a] + size[b] <= _LARGEST


@kernel
def _take(
    mesh: HalfEdgeMesh,
    h: int,
    release: Vectors,
    quota: NDArray[np.int64],
    root: Indices,
    size: Indices,
    weak: NDArray[np.bool_],
) -> None:
    """Make the edge of h weak and join the cracks at its ends."""
    g = mesh.twin[h]
    weak[h] = weak[g] = True
    quota[_band(mesh, h, release, len(quota))] -= 1
    a, b = find_root(root, mesh.tail[h]), find_root(root, mesh.tail[g])
    root[a] = b
    size[b] += size[a]


@kernel
def _next_edge(
    mesh: HalfEdgeMesh,
    h: int,
    release: Vectors,
    chance: Vectors,
    threshold: float,
    quota: NDArray[np.int64],
    root: Indices,
    size: Indices,
) -> int:
    """The half-edge that continues a crack at the head of h within the cosine `threshold`; -1 for none.

    Which of the usable ones is left to chance.
    """
    head = mesh.tail[mesh.twin[h]]
    best = -1
    leaving = mesh.half_edge[head]
    while leaving >= 0:
        if mesh.twin[leaving] >= 0 and _is_usable(mesh, leaving, release, quota, root, size):
            is_ahead = _cosine(mesh, h, leaving) >= threshold
            if is_ahead and (best < 0 or chance[leaving] < chance[best]):
                best = leaving
        leaving = mesh.twin[prev_of(leaving)]
        if leaving == mesh.half_edge[head]:
            break
    return best


@kernel
def _cosine(mesh: HalfEdgeMesh, h: int, g: int) -> float:
    """The cosine of the angle between two half-edges, at rest."""
    dot = 0.0
    squared_h = 0.0
    squared_g = 0.0
    for axis in range(3):
        x = mesh.rest_positions[mesh.tail[mesh.twin[h]], axis] - mesh.rest_positions[mesh.tail[h], axis]
        y = mesh.rest_positions[mesh.tail[mesh.twin[g]], axis] - mesh.rest_positions[mesh.tail[g], axis]
        dot += x * y
        squared_h += x * x
        squared_g += y * y
    return dot / np.sqrt(squared_h * squared_g) if squared_h > 0.0 and squared_g > 0.0 else -1.0
