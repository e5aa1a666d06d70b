"""Feature lines: the creases, boundaries and group borders that remeshing keeps, as chains between corners.

A chain is a polyline of input edges between two corners. A vertex of the new mesh on a chain is known by
its arc length, so it can only slide along the input's own line. Creases come from the dihedral angle; on a
noisy scan most of these edges are noise, so short ones go. Corners are where chains meet or end, where a
line turns at the scale of the new edges, and two on every loop, so that each chain has two different ends.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.connectivity import FREE, EditableMesh
from weathercoat.mesh.surface import Indices, Vectors, face_normals

_TURN = np.radians(50.0)  # a line that turns by more than this within an edge length has a corner there
_SHARP_TURN = np.radians(70.0)  # such corners may be closer together than an edge length
_SHORT = 4.0  # crease networks shorter than this many edge lengths are noise
_SHORT_CHAIN = 1.5  # and networks whose chains are shorter than this on average
_DANGLING = 2.0  # so are branches with a free end, shorter than this


class Features(NamedTuple):
    """Chains and what lies on them.

    crease: int32 (3 m,), the chain of each half-edge of the input or -1. vertex_chain: int32 (n,), FREE,
    the chain, or -2 - k for corner k; vertex_arc: (n,), arc length along the chain. Chain c has the points
    offset[c]:offset[c + 1] of `point` (., 3) with arc lengths `arc`, and the corners `first[c]` and
    `last[c]`; `kept[c]` says that it is a boundary or a border of groups.
    """

    crease: Indices
    vertex_chain: Indices
    vertex_arc: Vectors
    offset: Indices
    point: Vectors
    arc: Vectors
    first: Indices
    last: Indices
    kept: NDArray[np.bool_]


def find_features(
    vertices: Vectors,
    faces: Indices,
    twin: Indices,
    face_group: Indices,
    crease_angle: float,
    edge_length: float,
    seams: NDArray[np.bool_] | None = None,
) -> Features:
    """The features of a manifold mesh, vertices (n, 3), faces (m, 3), for new edges of length `edge_length`.

    Creases bend by more than `crease_angle` [rad]; boundaries and borders of `face_group` (m,) are kept
    always. Seams of texture coordinates (3 m,) are kept like creases: but for short and dense ones, as
    between the many small charts of an automatic atlas, whose lines would leave no room for even triangles.
    """
    tail = faces.reshape(-1)
    head = np.roll(faces, -1, axis=1).reshape(-1)
    h = np.flatnonzero((twin < 0) | (np.arange(len(twin)) < twin))
    normal = face_normals(vertices, faces)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    inner = twin[h] >= 0
    face, other = h // 3, np.where(inner, twin[h], h) // 3
    cosine = np.einsum("ij,ij->i", normal[face], normal[other])
    has_normal = (length[face, 0] > 0) & (length[other, 0] > 0)
    kept = ~inner | (face_group[face] != face_group[other])
    bent = inner & has_normal & (cosine < np.cos(crease_angle)) & ~kept
    span = np.linalg.norm(vertices[head[h]] - vertices[tail[h]], axis=1)
    bent[bent] = ~_is_noise(tail[h], head[h], span, bent, kept, len(vertices), edge_length)[bent]
    if seams is not None:
        cut = seams[h] & ~kept & ~bent
        lines = kept | bent
        bent |= cut & ~_is_noise(tail[h], head[h], span, cut, lines, len(vertices), edge_length)
    always = np.zeros(len(twin), np.bool_)
    always[h[kept]] = True
    return _trace(vertices, tail, head, twin, h[kept | bent], always, edge_length)


def _is_noise(
    tail: Indices,
    head: Indices,
    span: Vectors,
    bent: NDArray[np.bool_],
    kept: NDArray[np.bool_],
    vertex_count: int,
    edge_length: float,
) -> NDArray[np.bool_]:
    """Which creases belong to short networks or to short branches that end nowhere."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    drop = np.zeros(len(bent), np.bool_)
    if not bent.any():
        return drop
    rooted = np.zeros(vertex_count, np.bool_)
    rooted[tail[kept]] = True
    rooted[head[kept]] = True
    _prune_branches(tail, head, span, bent, rooted, drop, _DANGLING * edge_length, vertex_count)
    left = np.flatnonzero(bent & ~drop)
    graph = coo_array((np.ones(len(left)), (tail[left], head[left])), shape=(vertex_count, vertex_count))
    network = connected_components(graph, directed=False)[1][tail[left]]
    total = np.bincount(network, span[left])
    degree = np.bincount(np.concatenate([tail[left], head[left]]), minlength=vertex_count)
    ends = np.bincount(network, 1.0 * (degree[tail[left]] != 2) + (degree[head[left]] != 2))
    drop[left] = (total < np.maximum(_SHORT, 0.5 * _SHORT_CHAIN * ends) * edge_length)[network]
    loops = ends == 0
    drop[left] &= ~(loops[network] & (total[network] > edge_length))
    return drop


@kernel
def _prune_branches(
    tail: Indices,
    head: Indices,
    span: Vectors,
    bent: NDArray[np.bool_],
    rooted: NDArray[np.bool_],
    drop: NDArray[np.bool_],
    shortest: float,
    vertex_count: int,
) -> None:
    """Drop branches of creases, from a free end to a junction, shorter than `shortest`, repeatedly."""
    degree = np.zeros(vertex_count, np.int64)
    ends = np.zeros(
        vertex_count, np.int64
    )  # exclusive or of the edges at a vertex: where only one is left, it
    for e in range(len(tail)):
        if bent[e]:
            for v in (tail[e], head[e]):
                degree[v] += 1
                ends[v] ^= e
    walked = np.empty(len(tail), np.int64)
    dropped = True
    while dropped:
        dropped = False
        for start in range(vertex_count):
            if degree[start] != 1 or rooted[start]:
                continue
            v, e, total, count = start, ends[start], 0.0, 0
            while True:
                total += span[e]
                walked[count] = e
                count += 1
                v = head[e] if tail[e] == v else tail[e]
                if degree[v] != 2 or rooted[v] or total >= shortest:
                    break
                e ^= ends[v]
            if total >= shortest:
                continue
            dropped = True
            for i in range(count):
                drop[walked[i]] = True
                for v in (tail[walked[i]], head[walked[i]]):
                    degree[v] -= 1
                    ends[v] ^= walked[i]


def _trace(
    vertices: Vectors,
    tail: Indices,
    head: Indices,
    twin: Indices,
    features: Indices,
    always: NDArray[np.bool_],
    edge_length: float,
) -> Features:
    """Chains of the feature edges, each given by a half-edge; `always` (3 m,) marks those that must stay."""
    vertex_count = len(vertices)
    ends = np.concatenate([tail[features], head[features]])
    order = np.argsort(ends, kind="stable")
    start = np.zeros(vertex_count + 1, np.int64)
    np.cumsum(np.bincount(ends, minlength=vertex_count), out=start[1:])
    around = np.concatenate([features, features])[order].astype(np.int32)
    walk, walk_half_edge, offset = _walk_chains(start, around, tail, head, len(tail))
    is_node = np.diff(start) != 2
    walk, walk_half_edge, offset = _cut_at_turns(vertices, walk, walk_half_edge, offset, is_node, edge_length)

    chain_count = len(offset) - 1
    point = vertices[walk]
    step = np.zeros(len(walk))
    step[1:] = np.linalg.norm(point[1:] - point[:-1], axis=1)
    step[offset[:-1]] = 0.0
    arc = np.cumsum(step)
    size = np.diff(offset)
    arc -= np.repeat(arc[offset[:-1]], size)

    owner = np.repeat(np.arange(chain_count, dtype=np.int32), size)
    vertex_chain = np.full(vertex_count, FREE, np.int32)
    vertex_arc = np.zeros(vertex_count)
    vertex_chain[walk] = owner
    vertex_arc[walk] = arc
    first_vertex, last_vertex = walk[offset[:-1]], walk[offset[1:] - 1]
    corners, numbered = np.unique(np.concatenate([first_vertex, last_vertex]), return_inverse=True)
    vertex_chain[corners] = -2 - np.arange(len(corners), dtype=np.int32)
    crease = np.full(len(tail), -1, np.int32)
    inside = np.ones(len(walk), np.bool_)
    inside[offset[1:] - 1] = False
    along = walk_half_edge[inside]
    crease[along] = owner[inside]
    paired = twin[along] >= 0
    crease[twin[along[paired]]] = owner[inside][paired]
    return Features(
        crease=crease,
        vertex_chain=vertex_chain,
        vertex_arc=vertex_arc,
        offset=offset.astype(np.int32),
        point=point,
        arc=arc,
        first=numbered[:chain_count].astype(np.int32),
        last=numbered[chain_count:].astype(np.int32),
        kept=np.bincount(owner[inside], always[along], chain_count) > 0,
    )


@kernel
def _walk_chains(
    start: NDArray[np.int64], around: Indices, tail: Indices, head: Indices, half_edge_count: int
) -> tuple[Indices, Indices, Indices]:
    """Vertices and half-edges of all chains in a row, first from node to node, then loops; offsets."""
    done = np.zeros(half_edge_count, np.bool_)
    edge_count = len(around) // 2
    walk = np.empty(2 * edge_count, np.int32)
    walk_half_edge = np.full(2 * edge_count, -1, np.int32)
    offset = np.zeros(edge_count + 1, np.int32)
    used = chains = 0
    for loops in (False, True):
        for v in range(len(start) - 1):
            degree = start[v + 1] - start[v]
            if degree == 0 or (degree == 2 and not loops):
                continue
            for i in range(start[v], start[v + 1]):
                h = around[i]
                if done[h]:
                    continue
                u = v
                while True:
                    done[h] = True
                    walk[used] = u
                    walk_half_edge[used] = h
                    used += 1
                    u = head[h] if tail[h] == u else tail[h]
                    if start[u + 1] - start[u] != 2 or u == v:
                        break
                    h = around[start[u]] if around[start[u]] != h else around[start[u] + 1]
                walk[used] = u
                used += 1
                chains += 1
                offset[chains] = used
    return walk[:used].copy(), walk_half_edge[:used].copy(), offset[: chains + 1].copy()


def _cut_at_turns(
    vertices: Vectors,
    walk: Indices,
    walk_half_edge: Indices,
    offset: Indices,
    is_node: NDArray[np.bool_],
    edge_length: float,
) -> tuple[Indices, Indices, Indices]:
    """The same chains cut at their corners, and loops cut at two at least; chains end at `is_node` (n,)."""
    new_walk, new_half_edge, new_offset = [], [], [0]
    for c in range(len(offset) - 1):
        line = walk[offset[c] : offset[c + 1]]
        edges = walk_half_edge[offset[c] : offset[c + 1]]
        cuts, line, edges = _find_cuts(vertices, line, edges, bool(is_node[line[0]]), edge_length)
        for first, last in itertools.pairwise(cuts):
            new_walk.append(line[first : last + 1])
            new_half_edge.append(np.append(edges[first:last], np.int32(-1)))
            new_offset.append(new_offset[-1] + last + 1 - first)
    if not new_walk:
        return walk, walk_half_edge, offset
    return np.concatenate(new_walk), np.concatenate(new_half_edge), np.array(new_offset, np.int32)


def _find_cuts(
    vertices: Vectors, line: Indices, edges: Indices, at_node: bool, edge_length: float
) -> tuple[list[int], Indices, Indices]:
    """Where a chain has its corners, ends included; a loop without a node is turned to begin at one."""
    last = len(line) - 1
    is_loop = line[0] == line[-1]
    if last == 1:
        return [0, 1], line, edges
    turn, arc = _turning(vertices[line], is_loop, edge_length)
    if is_loop and not at_node:
        begin = int(np.argmax(turn[:-1]))
        if begin:
            turned = np.concatenate([line[begin:-1], line[: begin + 1]])
            edges = np.concatenate([edges[begin:-1], edges[:begin], edges[-1:]])
            return _find_cuts_of_turned(vertices, turned, edges, edge_length)
    return _find_cuts_of_turned(vertices, line, edges, edge_length, turn, arc)


def _find_cuts_of_turned(
    vertices: Vectors,
    line: Indices,
    edges: Indices,
    edge_length: float,
    turn: Vectors | None = None,
    arc: Vectors | None = None,
) -> tuple[list[int], Indices, Indices]:
    last = len(line) - 1
    is_loop = line[0] == line[-1]
    if turn is None or arc is None:
        turn, arc = _turning(vertices[line], is_loop, edge_length)
    cuts = [0, last]
    for i in np.argsort(-turn[1:last], kind="stable") + 1:
        if turn[i] < _TURN:
            break
        spacing = (0.3 if turn[i] > _SHARP_TURN else 1.0) * edge_length
        if all(abs(arc[i] - arc[j]) >= spacing for j in cuts):
            cuts.append(int(i))
    if is_loop and len(cuts) == 2:
        cuts.append(1 + int(np.argmin(np.abs(arc[1:last] - 0.5 * arc[last]))))
    return sorted(cuts), line, edges


def _turning(line: Vectors, is_loop: bool, edge_length: float) -> tuple[Vectors, Vectors]:
    """By how much the line turns at each of its points within an edge length [rad], and its arc length."""
    step = np.linalg.norm(line[1:] - line[:-1], axis=1)
    arc = np.concatenate([[0.0], np.cumsum(step)])
    total = arc[-1]
    reach = 0.5 * edge_length
    if is_loop:
        reach = min(reach, 0.25 * total)
        known = np.concatenate([arc[:-1] - total, arc, arc[1:] + total])
        points = np.concatenate([line[:-1], line, line[1:]])
        back, ahead = arc - reach, arc + reach
    else:
        known, points = arc, line
        span = np.minimum(reach, np.minimum(arc, total - arc))
        back, ahead = arc - span, arc + span
    before = line - np.stack([np.interp(back, known, points[:, k]) for k in range(3)], axis=1)
    after = np.stack([np.interp(ahead, known, points[:, k]) for k in range(3)], axis=1) - line
    sine = np.linalg.norm(np.cross(before, after), axis=1)
    return np.arctan2(sine, np.einsum("ij,ij->i", before, after)), arc


def release_chains(mesh: EditableMesh, chains: NDArray[np.bool_]) -> None:
    """Make the edges of the marked chains ordinary ones, and vertices that no other feature holds free."""
    crease = mesh.crease[: 3 * int(mesh.count[1])]
    crease[(crease >= 0) & chains[crease]] = -1
    held = np.zeros(len(mesh.chain), np.bool_)
    half_edges = np.flatnonzero(crease >= 0)
    held[mesh.tail[half_edges]] = True
    held[mesh.tail[half_edges - half_edges % 3 + (half_edges + 1) % 3]] = True
    mesh.chain[~held] = FREE


@kernel
def place_on_chain(chain: int, s: float, offset: Indices, arc: Vectors, point: Vectors, out: Vectors) -> int:
    """Write the point at arc length s of a chain to `out` (3,); returns the number of its segment."""
    low, high = offset[chain], offset[chain + 1] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if arc[middle] <= s:
            low = middle
        else:
            high = middle
    span = arc[high] - arc[low]
    t = (s - arc[low]) / span if span > 0 else 0.0
    t = min(max(t, 0.0), 1.0)
    for axis in range(3):
        out[axis] = (1.0 - t) * point[low, axis] + t * point[high, axis]
    return low
