"""Passes over an `EditableMesh` that split long edges, collapse short ones and flip towards better triangles.

Every edit is asked first whether it keeps the mesh a valid one: the link condition, features, no face
turned over. `normals` are the unit normals of the input's faces (m, 3), by which a face that faces inwards
is known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.connectivity import FREE, EditableMesh, collapse_edge, flip_edge, split_edge
from weathercoat.mesh.creases import Features, place_on_chain
from weathercoat.mesh.halfedge import next_of, prev_of
from weathercoat.mesh.slices import AT_ONCE, in_slices
from weathercoat.mesh.surface import Indices, Vectors

_LEAST_COSINE = 0.3  # by more than this angle no edit may turn a face
_LEAST_SHAPE = 0.05  # no edit may make a triangle worse than this (1 is equilateral), unless it was worse


@kernel
def edge_length_of(h: int, mesh: EditableMesh) -> float:
    """Length of the edge of h."""
    a, b = mesh.tail[h], mesh.tail[next_of(h)]
    p = mesh.position
    return np.sqrt((p[a, 0] - p[b, 0]) ** 2 + (p[a, 1] - p[b, 1]) ** 2 + (p[a, 2] - p[b, 2]) ** 2)


@kernel
def edge_lengths(mesh: EditableMesh) -> Vectors:
    """Length of each edge at its representative half-edge, -1 at the others and at what is gone."""
    p, tail, twin = mesh.position, mesh.tail, mesh.twin
    length = np.full(3 * mesh.count[1], -1.0)
    for h in range(len(length)):
        if tail[h] >= 0 and twin[h] < h:
            a, b = tail[h], tail[next_of(h)]
            length[h] = np.sqrt(
                (p[a, 0] - p[b, 0]) ** 2 + (p[a, 1] - p[b, 1]) ** 2 + (p[a, 2] - p[b, 2]) ** 2
            )
    return length


@kernel
def arc_on(v: int, chain: int, mesh: EditableMesh, features: Features) -> float:
    """Arc length along `chain` of a vertex on it or at one of its ends."""
    if mesh.chain[v] >= 0:
        return mesh.arc[v]
    if features.first[chain] == -2 - mesh.chain[v]:
        return 0.0
    return features.arc[features.offset[chain + 1] - 1]


@kernel
def longer_feature_beside(h: int, mesh: EditableMesh) -> int:
    """The longest feature edge of the two faces of h that is longer than h; h itself where there is none.

    Flips cannot repair a flat triangle whose longest side is a feature, so that side has to be split first.
    """
    best, length = h, edge_length_of(h, mesh)
    if mesh.crease[h] >= 0:
        return h
    for side in range(2):
        k = h if side == 0 else mesh.twin[h]
        for other in (next_of(k), prev_of(k)):
            if mesh.crease[other] >= 0 and edge_length_of(other, mesh) > length:
                best, length = other, edge_length_of(other, mesh)
    return best


@kernel
def split_pass(
    candidates: Indices,
    ratios: Vectors,
    inner_limit: float,
    feature_limit: float,
    mesh: EditableMesh,
    features: Features,
) -> int:
    """Split the candidates, half-edges, that are longer than their limit at `ratios`; returns how many."""
    done = 0
    for i in range(len(candidates)):
        h = candidates[i]
        if edge_length_of(h, mesh) <= (inner_limit if mesh.crease[h] < 0 else feature_limit):
            continue
        h = longer_feature_beside(h, mesh)
        chain = mesh.crease[h]
        a, b = mesh.tail[h], mesh.tail[next_of(h)]
        t = ratios[i]
        if chain >= 0:
            s = (1.0 - t) * arc_on(a, chain, mesh, features) + t * arc_on(b, chain, mesh, features)
        m = split_edge(h, mesh)
        mesh.chain[m] = chain if chain >= 0 else FREE
        if chain >= 0:
            mesh.arc[m] = s
            place_on_chain(chain, s, features.offset, features.arc, features.point, mesh.position[m])
        else:
            for axis in range(3):
                mesh.position[m, axis] = (1.0 - t) * mesh.position[a, axis] + t * mesh.position[b, axis]
        done += 1
    return done


@kernel
def _corner_normal(p: Vectors, a: int, b: int, c: int) -> tuple[float, float, float]:
    ux, uy, uz = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
    vx, vy, vz = p[c, 0] - p[a, 0], p[c, 1] - p[a, 1], p[c, 2] - p[a, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@kernel
def shape_of(p: Vectors, a: int, b: int, c: int) -> float:
    """1 for an equilateral triangle, 0 for a degenerate one."""
    x, y, z = _corner_normal(p, a, b, c)
    total = 0.0
    for axis in range(3):
        total += (
            (p[a, axis] - p[b, axis]) ** 2 + (p[b, axis] - p[c, axis]) ** 2 + (p[c, axis] - p[a, axis]) ** 2
        )
    return 2.0 * np.sqrt(3.0 * (x * x + y * y + z * z)) / total if total > 0 else 0.0


@kernel
def _normal_and_shape(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, cx: float, cy: float, cz: float
) -> tuple[float, float, float, float]:
    """Normal, with twice the area as length, and `shape_of` the triangle of three points."""
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    wx, wy, wz = bx - cx, by - cy, bz - cz
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    total = (ux * ux + wx * wx + vx * vx) + (uy * uy + wy * wy + vy * vy) + (uz * uz + wz * wz + vz * vz)
    shape = 2.0 * np.sqrt(3.0 * (x * x + y * y + z * z)) / total if total > 0 else 0.0
    return x, y, z, shape


@kernel
def may_move(v: int, avoid: int, target: Vectors, mesh: EditableMesh, normals: Vectors) -> bool:
    """Whether v may move to `target` (3,): turns over or flattens no face but those of vertex `avoid`."""
    p, tail, twin, sources = mesh.position, mesh.tail, mesh.twin, mesh.source
    old_x, old_y, old_z = p[v, 0], p[v, 1], p[v, 2]
    to_x, to_y, to_z = target[0], target[1], target[2]
    first = mesh.half_edge[v]
    h = first
    while True:
        b, c = tail[next_of(h)], tail[prev_of(h)]
        if b != avoid and c != avoid:
            bx, by, bz, cx, cy, cz = p[b, 0], p[b, 1], p[b, 2], p[c, 0], p[c, 1], p[c, 2]
            x, y, z, shape = _normal_and_shape(old_x, old_y, old_z, bx, by, bz, cx, cy, cz)
            new_x, new_y, new_z, new_shape = _normal_and_shape(to_x, to_y, to_z, bx, by, bz, cx, cy, cz)
            if new_shape < min(shape, _LEAST_SHAPE):
                return False
            size = np.sqrt((x * x + y * y + z * z) * (new_x * new_x + new_y * new_y + new_z * new_z))
            if shape > _LEAST_SHAPE and x * new_x + y * new_y + z * new_z < _LEAST_COSINE * size:
                return False
            source = sources[h // 3]
            nx, ny, nz = normals[source, 0], normals[source, 1], normals[source, 2]
            facing = new_x * nx + new_y * ny + new_z * nz
            if facing < 0.0 and (shape <= _LEAST_SHAPE or x * nx + y * ny + z * nz > 0.0):
                return False
        h = twin[prev_of(h)]
        if h < 0 or h == first:
            return True


@kernel
def face_count_at(v: int, mesh: EditableMesh) -> tuple[int, bool]:
    """How many faces vertex v has, and whether they go all the way round."""
    twin = mesh.twin
    first = mesh.half_edge[v]
    h, count = first, 0
    while True:
        count += 1
        h = twin[prev_of(h)]
        if h < 0:
            return count, False
        if h == first:
            return count, True


@kernel
def are_neighbours(u: int, v: int, mesh: EditableMesh) -> bool:
    """Whether an edge joins u and v."""
    tail, twin = mesh.tail, mesh.twin
    first = mesh.half_edge[u]
    h = first
    while True:
        if tail[next_of(h)] == v or tail[prev_of(h)] == v:
            return True
        h = twin[prev_of(h)]
        if h < 0 or h == first:
            return False


@kernel
def _common_neighbours(a: int, b: int, mesh: EditableMesh) -> int:
    first = mesh.half_edge[a]
    h, count = first, 0
    while True:
        u = mesh.tail[next_of(h)]
        if u != b and are_neighbours(u, b, mesh):
            count += 1
        p = prev_of(h)
        h = mesh.twin[p]
        if h < 0:
            u = mesh.tail[p]
            return count + (1 if u != b and are_neighbours(u, b, mesh) else 0)
        if h == first:
            return count


@kernel
def _side_allows(h: int, mesh: EditableMesh) -> bool:
    """Whether the face of h may vanish: its apex keeps enough faces, its other sides are no features both."""
    if mesh.crease[next_of(h)] >= 0 and mesh.crease[prev_of(h)] >= 0:
        return False
    count, closed = face_count_at(mesh.tail[prev_of(h)], mesh)
    return count >= (4 if closed else 2)


@kernel
def keeps_topology(h: int, mesh: EditableMesh) -> bool:
    """Whether collapsing the edge of h keeps the mesh a manifold of the same kind."""
    g = mesh.twin[h]
    a, b = mesh.tail[h], mesh.tail[next_of(h)]
    if not _side_allows(h, mesh):
        return False
    if g >= 0 and (not _side_allows(g, mesh) or mesh.tail[prev_of(h)] == mesh.tail[prev_of(g)]):
        return False
    return _common_neighbours(a, b, mesh) == (2 if g >= 0 else 1)


@kernel
def _farthest_neighbour(v: int, avoid: int, target: Vectors, mesh: EditableMesh) -> float:
    """Largest squared distance of `target` from the neighbours of v but `avoid`."""
    p, tail, twin = mesh.position, mesh.tail, mesh.twin
    first = mesh.half_edge[v]
    h, farthest = first, 0.0
    while True:
        for u in (tail[next_of(h)], tail[prev_of(h)]):
            if u != avoid:
                d = (p[u, 0] - target[0]) ** 2 + (p[u, 1] - target[1]) ** 2 + (p[u, 2] - target[2]) ** 2
                farthest = max(farthest, d)
        h = twin[prev_of(h)]
        if h < 0 or h == first:
            return farthest


@kernel
def try_collapse(
    h: int, longest: float, target: Vectors, mesh: EditableMesh, features: Features, normals: Vectors
) -> bool:
    """Collapse the edge of h if allowed and if no edge gets longer than `longest`; target (3,) is scratch."""
    a, b = mesh.tail[h], mesh.tail[next_of(h)]
    chain_a, chain_b, along = mesh.chain[a], mesh.chain[b], mesh.crease[h]
    if chain_a != FREE and chain_b != FREE and (along < 0 or (chain_a < FREE and chain_b < FREE)):
        return False
    chain, arc = chain_b, mesh.arc[b]
    p = mesh.position
    if chain_a == FREE and chain_b == FREE:
        for axis in range(3):
            target[axis] = 0.5 * (p[a, axis] + p[b, axis])
    elif chain_b == FREE or chain_a < FREE:
        chain, arc = chain_a, mesh.arc[a]
        for axis in range(3):
            target[axis] = p[a, axis]
    elif chain_a == FREE or chain_b < FREE:
        for axis in range(3):
            target[axis] = p[b, axis]
    else:
        arc = 0.5 * (mesh.arc[a] + mesh.arc[b])
        place_on_chain(along, arc, features.offset, features.arc, features.point, target)
    if (
        max(_farthest_neighbour(a, b, target, mesh), _farthest_neighbour(b, a, target, mesh))
        > longest * longest
    ):
        return False
    if not keeps_topology(h, mesh):
        return False
    if not may_move(a, b, target, mesh, normals) or not may_move(b, a, target, mesh, normals):
        return False
    collapse_edge(h, mesh)
    mesh.chain[b] = chain
    mesh.arc[b] = arc
    for axis in range(3):
        p[b, axis] = target[axis]
    return True


@kernel
def collapse_pass(
    candidates: Indices,
    limit: float,
    longest: float,
    mesh: EditableMesh,
    features: Features,
    normals: Vectors,
) -> int:
    """Collapse the candidates, half-edges, that are shorter than `limit`; returns how many."""
    done = 0
    target = np.empty(3)
    for i in range(len(candidates)):
        h = candidates[i]
        if mesh.tail[h] < 0 or edge_length_of(h, mesh) >= limit:
            continue
        if try_collapse(h, longest, target, mesh, features, normals):
            done += 1
    return done


@kernel
def _cotangent(p: Vectors, apex: int, a: int, b: int) -> float:
    x, y, z = _corner_normal(p, apex, a, b)
    dot = 0.0
    for axis in range(3):
        dot += (p[a, axis] - p[apex, axis]) * (p[b, axis] - p[apex, axis])
    return dot / max(np.sqrt(x * x + y * y + z * z), 1e-300)


@kernel
def may_flip(h: int, mesh: EditableMesh, normals: Vectors) -> bool:
    """Whether flipping the inner edge of h keeps the mesh a manifold and turns no face over."""
    p, tail = mesh.position, mesh.tail
    g = mesh.twin[h]
    a, b, c, d = tail[h], tail[g], tail[prev_of(h)], tail[prev_of(g)]
    if c == d or are_neighbours(c, d, mesh):
        return False
    ox, oy, oz = _corner_normal(p, a, b, c)
    ex, ey, ez = _corner_normal(p, b, a, d)
    old = np.sqrt(ox * ox + oy * oy + oz * oz) * np.sqrt(ex * ex + ey * ey + ez * ez)
    worst_old = min(shape_of(p, a, b, c), shape_of(p, b, a, d))
    if worst_old > _LEAST_SHAPE and ox * ex + oy * ey + oz * ez < _LEAST_COSINE * old:
        return False
    if min(shape_of(p, a, d, c), shape_of(p, d, b, c)) <= min(worst_old, _LEAST_SHAPE):
        return False
    sx, sy, sz = ox + ex, oy + ey, oz + ez
    mean = np.sqrt(sx * sx + sy * sy + sz * sz)
    for left in range(2):
        x, y, z = _corner_normal(p, a, d, c) if left == 0 else _corner_normal(p, d, b, c)
        size = np.sqrt(x * x + y * y + z * z)
        if x * sx + y * sy + z * sz < _LEAST_COSINE * size * mean:
            return False
        source = mesh.source[h // 3 if left == 0 else g // 3]
        if x * normals[source, 0] + y * normals[source, 1] + z * normals[source, 2] <= 0.0:
            return False
    return True


@kernel
def face_shapes(mesh: EditableMesh) -> Vectors:
    """`shape_of` each face, 1 for what is gone."""
    shape = np.ones(mesh.count[1])
    for f in range(len(shape)):
        a, b, c = mesh.tail[3 * f], mesh.tail[3 * f + 1], mesh.tail[3 * f + 2]
        if a >= 0:
            shape[f] = shape_of(mesh.position, a, b, c)
    return shape


@kernel
def smallest_angles(mesh: EditableMesh) -> Vectors:
    """Smallest angle of each face of a compact mesh [rad], (m,)."""
    angle = np.full(mesh.count[1], np.pi)
    for f in range(len(angle)):
        for i in range(3):
            a, b, c = mesh.tail[3 * f + i], mesh.tail[3 * f + (i + 1) % 3], mesh.tail[3 * f + (i + 2) % 3]
            cotangent = _cotangent(mesh.position, a, b, c)
            angle[f] = min(angle[f], np.arctan2(1.0, cotangent))
    return angle


@kernel
def valence_excess(mesh: EditableMesh) -> Indices:
    """Edges at each vertex beyond the six of a regular one, four at a boundary; int32 (n,)."""
    tail, twin, start = mesh.tail, mesh.twin, mesh.half_edge
    excess = np.zeros(len(start), np.int32)
    for v in range(mesh.count[0]):
        if start[v] >= 0:
            excess[v] = -6 if twin[start[v]] >= 0 else -3
    for h in range(3 * mesh.count[1]):
        if tail[h] >= 0:
            excess[tail[h]] += 1
    return excess


@kernel
def flip_pass(
    mesh: EditableMesh,
    normals: Vectors,
    excess: Indices,
    regularity: float,
    is_due: NDArray[np.bool_],
    first: int,
    last: int,
) -> int:
    """Flip inner edges that are not Delaunay or whose flip makes valences regular, of the half-edges from
    `first` to before `last`; returns how many.

    An edge is flipped where cot α + cot β of the opposite angles is below `regularity` times half the
    decrease of the sum of squares of `excess`, which is brought up to date. Only edges whose half-edge is
    marked in `is_due` (3 m,) are looked at; those about which a flip changed something are due again.
    """
    p, tail, twin, crease, chain = mesh.position, mesh.tail, mesh.twin, mesh.crease, mesh.chain
    done = 0
    for h in range(first, last):
        if not is_due[h]:
            continue
        is_due[h] = False
        g = twin[h]
        if tail[h] < 0 or g < h or crease[h] >= 0:
            continue
        a, b, c, d = tail[h], tail[g], tail[prev_of(h)], tail[prev_of(g)]
        gain = 0
        for v, change in ((a, -1), (b, -1), (c, 1), (d, 1)):
            if chain[v] >= FREE:
                gain -= 2 * change * excess[v] + 1
        cotangents = _cotangent(p, c, a, b) + _cotangent(p, d, b, a)
        if cotangents < 0.5 * regularity * gain - 1e-9 and may_flip(h, mesh, normals):
            flip_edge(h, mesh)
            excess[a] -= 1
            excess[b] -= 1
            excess[c] += 1
            excess[d] += 1
            for v in (a, b, c, d):
                _mark_edges_about(v, mesh, is_due)
            done += 1
    return done


@kernel
def _mark_edges_about(v: int, mesh: EditableMesh, is_due: NDArray[np.bool_]) -> None:
    """Mark the edges of the faces of v, each at the smaller of its half-edges."""
    twin = mesh.twin
    first = mesh.half_edge[v]
    h = first
    while True:
        for k in range(h - h % 3, h - h % 3 + 3):
            is_due[k if twin[k] < 0 else min(k, twin[k])] = True
        h = twin[prev_of(h)]
        if h < 0 or h == first:
            return


@kernel
def mark_edges_about_new(first: int, mesh: EditableMesh, is_due: NDArray[np.bool_]) -> None:
    """Mark the edges whose flip the vertices from `first` on, which splits have added, may have changed.

    No face of the mesh may be gone.
    """
    tail, twin = mesh.tail, mesh.twin
    is_near = np.zeros(mesh.count[0], np.bool_)
    for h in range(3 * mesh.count[1]):
        a, b = tail[h], tail[next_of(h)]
        if a >= first or b >= first:
            is_near[a] = True
            is_near[b] = True
    for h in range(0, 3 * mesh.count[1], 3):
        if is_near[tail[h]] or is_near[tail[h + 1]] or is_near[tail[h + 2]]:
            for k in range(h, h + 3):
                is_due[k if twin[k] < 0 else min(k, twin[k])] = True


def flip_edges(
    mesh: EditableMesh,
    normals: Vectors,
    passes: int,
    regularity: float = 0.0,
    is_due: NDArray[np.bool_] | None = None,
) -> None:
    """Flip until nothing changes, or for that many passes, as `flip_pass` does; all edges are due if none are
    named."""
    excess = valence_excess(mesh)
    half_edges = 3 * int(mesh.count[1])
    if is_due is None:
        is_due = np.ones(half_edges, np.bool_)
    for _ in range(passes):
        done = 0
        for part in in_slices(half_edges, 10 * AT_ONCE):
            done += flip_pass(mesh, normals, excess, regularity, is_due, part.start, part.stop)
        if done == 0:
            return
