"""Removal of degenerate and folded faces from an `EditableMesh`.

Ordinary passes refuse every edit that would leave a bad face, so a tangle that the input brought along, or
that detail far below the edge length made, blocks them all. Here an edit of such a place is accepted where it
makes the worst face about it better, whatever it does to evenness.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.connectivity import FREE, EditableMesh, collapse_edge, flip_edge
from weathercoat.mesh.creases import Features
from weathercoat.mesh.edits import are_neighbours, edge_length_of, keeps_topology, shape_of
from weathercoat.mesh.halfedge import next_of, prev_of
from weathercoat.mesh.surface import Indices, Vectors

BAD_SHAPE = 0.05
"""`edits.shape_of` below which a face is to be mended, where that succeeds."""
DEGENERATE = 0.004
"""`edits.shape_of` below which a face is degenerate; an angle of 0.1° is 0.003 or less."""

_FOLDED = -0.3  # cosine to the mean normal about it below which a face is folded over
_GAIN = 1e-6  # by which the worst face has to become better


@kernel
def _signed_shape(p: Vectors, a: int, b: int, c: int, mean: Vectors) -> float:
    """Shape of a face, negative where it is folded against the direction `mean` (3,)."""
    shape = shape_of(p, a, b, c)
    ux, uy, uz = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
    vx, vy, vz = p[c, 0] - p[a, 0], p[c, 1] - p[a, 1], p[c, 2] - p[a, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    along = x * mean[0] + y * mean[1] + z * mean[2]
    size = np.sqrt((x * x + y * y + z * z) * (mean[0] ** 2 + mean[1] ** 2 + mean[2] ** 2))
    return -shape if along < _FOLDED * size else shape


@kernel
def _add_normals(v: int, mesh: EditableMesh, mean: Vectors) -> None:
    """Add the normals of the faces round v, by area, to `mean` (3,)."""
    p, tail = mesh.position, mesh.tail
    first = mesh.half_edge[v]
    h = first
    while True:
        b, c = tail[next_of(h)], tail[prev_of(h)]
        ux, uy, uz = p[b, 0] - p[v, 0], p[b, 1] - p[v, 1], p[b, 2] - p[v, 2]
        wx, wy, wz = p[c, 0] - p[v, 0], p[c, 1] - p[v, 1], p[c, 2] - p[v, 2]
        mean[0] += uy * wz - uz * wy
        mean[1] += uz * wx - ux * wz
        mean[2] += ux * wy - uy * wx
        h = mesh.twin[prev_of(h)]
        if h < 0 or h == first:
            return


@kernel
def _worst_at(v: int, avoid: int, place: Vectors, mean: Vectors, mesh: EditableMesh) -> tuple[float, int]:
    """Worst signed shape of the faces round v but those of vertex `avoid`, were v at `place` (3,).

    Also how many of them are degenerate or folded.
    """
    p, tail = mesh.position, mesh.tail
    x, y, z = p[v, 0], p[v, 1], p[v, 2]
    p[v, 0], p[v, 1], p[v, 2] = place[0], place[1], place[2]
    worst, wrong = 1.0, 0
    first = mesh.half_edge[v]
    h = first
    while True:
        b, c = tail[next_of(h)], tail[prev_of(h)]
        if b != avoid and c != avoid:
            shape = _signed_shape(p, v, b, c, mean)
            worst = min(worst, shape)
            wrong += 1 if shape < DEGENERATE else 0
        h = mesh.twin[prev_of(h)]
        if h < 0 or h == first:
            break
    p[v, 0], p[v, 1], p[v, 2] = x, y, z
    return worst, wrong


@kernel
def _is_better(after: float, wrong_after: int, before: float, wrong_before: int) -> bool:
    """Whether a place with that worst face and so many degenerate or folded ones is better than before."""
    return wrong_after < wrong_before or (wrong_after == wrong_before and after > before + _GAIN)


@kernel
def _rank(v: int, mesh: EditableMesh) -> int:
    """0 for a free vertex, 1 for one on a chain, 2 for a corner."""
    return 0 if mesh.chain[v] == FREE else (1 if mesh.chain[v] > FREE else 2)


@kernel
def _mend_by_collapse(h: int, short: float, mesh: EditableMesh, place: Vectors, mean: Vectors) -> bool:
    """Collapse the edge of h where that makes the worst face round its ends better; corners if `short`."""
    a, b = mesh.tail[h], mesh.tail[next_of(h)]
    rank_a, rank_b, along = _rank(a, mesh), _rank(b, mesh), mesh.crease[h]
    if rank_a > 0 and rank_b > 0 and along < 0:
        return False
    if rank_a == 2 and rank_b == 2 and edge_length_of(h, mesh) > short:
        return False
    twin = mesh.twin
    if twin[h] >= 0 and twin[mesh.half_edge[a]] < 0 and twin[mesh.half_edge[b]] < 0:
        return False  # from boundary to boundary
    if not keeps_topology(h, mesh):
        return False
    p = mesh.position
    mean[:] = 0.0
    _add_normals(a, mesh, mean)
    _add_normals(b, mesh, mean)
    worst_a, wrong_a = _worst_at(a, -1, p[a], mean, mesh)
    worst_b, wrong_b = _worst_at(b, a, p[b], mean, mesh)
    best, least, share = min(worst_a, worst_b), wrong_a + wrong_b, -1.0
    for trial in range(3):
        t = 0.5 * trial  # 0 at a, 1 at b
        if (t < 1.0 and rank_b > rank_a) or (t > 0.0 and rank_a > rank_b) or (t == 0.5 and rank_a > 0):
            continue
        for axis in range(3):
            place[axis] = (1.0 - t) * p[a, axis] + t * p[b, axis]
        worst_a, wrong_a = _worst_at(a, b, place, mean, mesh)
        worst_b, wrong_b = _worst_at(b, a, place, mean, mesh)
        if _is_better(min(worst_a, worst_b), wrong_a + wrong_b, best, least):
            best, least, share = min(worst_a, worst_b), wrong_a + wrong_b, t
    if share < 0.0:
        return False
    for axis in range(3):
        place[axis] = (1.0 - share) * p[a, axis] + share * p[b, axis]
    chain, arc = (mesh.chain[a], mesh.arc[a]) if share == 0.0 else (mesh.chain[b], mesh.arc[b])
    collapse_edge(h, mesh)
    mesh.chain[b], mesh.arc[b] = chain, arc
    p[b, 0], p[b, 1], p[b, 2] = place[0], place[1], place[2]
    return True


@kernel
def _mend_by_flip(h: int, mesh: EditableMesh, mean: Vectors) -> bool:
    """Flip the edge of h where that makes the worse of its faces better."""
    g = mesh.twin[h]
    if g < 0 or mesh.crease[h] >= 0:
        return False
    a, b, c, d = mesh.tail[h], mesh.tail[g], mesh.tail[prev_of(h)], mesh.tail[prev_of(g)]
    if c == d or are_neighbours(c, d, mesh):
        return False
    p = mesh.position
    mean[:] = 0.0
    _add_normals(a, mesh, mean)
    _add_normals(b, mesh, mean)
    before = min(_signed_shape(p, a, b, c, mean), _signed_shape(p, b, a, d, mean))
    after = min(_signed_shape(p, a, d, c, mean), _signed_shape(p, d, b, c, mean))
    if after <= before + _GAIN:
        return False
    flip_edge(h, mesh)
    return True


@kernel
def _mend_by_move(v: int, mesh: EditableMesh, place: Vectors, mean: Vectors) -> bool:
    """Move a free vertex to the mean of its neighbours where that makes the worst face round it better."""
    if mesh.chain[v] != FREE:
        return False
    p = mesh.position
    mean[:] = 0.0
    place[:] = 0.0
    _add_normals(v, mesh, mean)
    first = mesh.half_edge[v]
    h = first
    count = 0
    while True:
        u = mesh.tail[next_of(h)]
        for axis in range(3):
            place[axis] += p[u, axis]
        count += 1
        h = mesh.twin[prev_of(h)]
        if h == first:
            break
    for axis in range(3):
        place[axis] /= count
    before, wrong_before = _worst_at(v, -1, p[v], mean, mesh)
    after, wrong_after = _worst_at(v, -1, place, mean, mesh)
    if not _is_better(after, wrong_after, before, wrong_before):
        return False
    p[v, 0], p[v, 1], p[v, 2] = place[0], place[1], place[2]
    return True


@kernel
def find_bad_faces(mesh: EditableMesh, normal: Vectors) -> NDArray[np.bool_]:
    """Which faces are degenerate, or oppose the unit normals (n, 3) of all their vertices; (m,)."""
    p, tail = mesh.position, mesh.tail
    bad = np.zeros(mesh.count[1], np.bool_)
    for f in range(len(bad)):
        a, b, c = tail[3 * f], tail[3 * f + 1], tail[3 * f + 2]
        if a < 0:
            continue
        bad[f] = shape_of(p, a, b, c) < BAD_SHAPE or (
            _signed_shape(p, a, b, c, normal[a]) < 0
            and _signed_shape(p, a, b, c, normal[b]) < 0
            and _signed_shape(p, a, b, c, normal[c]) < 0
        )
    return bad


@kernel
def mend_pass(bad: Indices, short: float, mesh: EditableMesh) -> int:
    """Edit round the `bad` faces; corners are joined across edges up to `short`. Returns how many edits."""
    place, mean = np.empty(3), np.empty(3)
    done = 0
    for i in range(len(bad)):
        f = bad[i]
        if mesh.tail[3 * f] < 0:
            continue
        tried = 0
        longest = np.inf
        while tried < 3:
            # its sides from the shortest to the longest
            h, length = -1, np.inf
            for k in range(3 * f, 3 * f + 3):
                own = edge_length_of(k, mesh) + 1e-300 * (k - 3 * f)
                if own < length and (tried == 0 or own > longest):
                    h, length = k, own
            if h < 0:
                break
            longest = length
            tried += 1
            if _mend_by_collapse(h, short, mesh, place, mean):
                done += 1
                break
        if mesh.tail[3 * f] < 0:
            continue
        for k in range(3 * f, 3 * f + 3):
            if _mend_by_flip(k, mesh, mean):
                done += 1
                break
        for k in range(3 * f, 3 * f + 3):
            if _mend_by_move(mesh.tail[k], mesh, place, mean):
                done += 1
    return done


def release_around(mesh: EditableMesh, features: Features, faces: Indices) -> None:
    """Make creases at the corners of `faces` ordinary edges; boundaries and borders of groups stay."""
    count = 3 * int(mesh.count[1])
    tail, crease = mesh.tail[:count], mesh.crease[:count]
    h = np.arange(count)
    head = tail[h - h % 3 + (h + 1) % 3]
    marked = np.zeros(len(mesh.half_edge), np.bool_)
    marked[tail.reshape(-1, 3)[faces]] = True
    crease[(crease >= 0) & (marked[tail] | marked[head]) & ~features.kept[crease]] = -1
    held = np.zeros(len(mesh.half_edge), np.bool_)
    held[tail[crease >= 0]] = True
    held[head[crease >= 0]] = True
    mesh.chain[~held & marked] = FREE
