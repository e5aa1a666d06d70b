"""Fitting of an `EditableMesh` to the input where evenly spread vertices miss tips, lips and fine ridges.

Points of the input where it bends are sampled. Where one lies far from the mesh, the nearest free vertex
moves there and is held while its neighbours are smoothed; then edges that cut through or bridge a ridge are
flipped to the diagonal that is nearer to the input.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from weathercoat.compile import kernel
from weathercoat.mesh.closest import find_closest, make_closest_tree
from weathercoat.mesh.connectivity import FREE, EditableMesh, flip_edge
from weathercoat.mesh.edits import may_flip, may_move, shape_of
from weathercoat.mesh.halfedge import next_of, prev_of
from weathercoat.mesh.projection import InputSurface
from weathercoat.mesh.surface import Indices, Vectors

_BENT = np.cos(np.radians(3.0))  # samples lie on edges of the input that bend by more
_SPACING = 0.35  # of samples along long edges, in target lengths
_FIT_SHAPE = 0.5  # no fit may make a triangle worse than this, unless it was worse
_CLEARLY_NEARER = 0.7  # share of its distance to which a flip must bring an edge


def sample_bends(source: InputSurface, edge_length: float) -> tuple[Vectors, Indices]:
    """Points (k, 3) on the bent edges of the input, and a face (k,) of the input that each lies on."""
    h = np.flatnonzero(np.arange(len(source.twin)) < source.twin)
    cosine = np.einsum("ij,ij->i", source.normals[h // 3], source.normals[source.twin[h] // 3])
    h = h[cosine < _BENT].astype(np.int32)
    tail = source.faces.reshape(-1)
    a, b = tail[h], tail[h - h % 3 + (h + 1) % 3]
    vertices, first = np.unique(np.concatenate([a, b]), return_index=True)
    face = np.concatenate([h, h])[first] // 3
    inner = np.linalg.norm(source.vertices[b] - source.vertices[a], axis=1) / (_SPACING * edge_length)
    count = np.ceil(inner).astype(np.int64) - 1
    edge = np.repeat(np.arange(len(h)), count)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 1
    t = (step / (count[edge] + 1))[:, None]
    points = (1.0 - t) * source.vertices[a[edge]] + t * source.vertices[b[edge]]
    return (
        np.concatenate([source.vertices[vertices], points]),
        np.concatenate([face, h[edge] // 3]).astype(np.int32),
    )


def distances_to(mesh: EditableMesh, points: Vectors, hint: Indices) -> tuple[Vectors, Indices]:
    """Distance (k,) of points (k, 3) from a compact mesh, and its nearest face (k,), perhaps `hint` (k,)."""
    tree = make_closest_tree(mesh.position, mesh.tail.reshape(-1, 3))
    face, near = find_closest(tree, points, hint)
    return np.linalg.norm(near - points, axis=1), face


@kernel
def snap_pass(
    points: Vectors,
    below: Indices,
    near: Indices,
    held: NDArray[np.bool_],
    mesh: EditableMesh,
    normals: Vectors,
) -> int:
    """Move the free vertex of face near[i] that is nearest to points[i] there, once; returns how many moved.

    `below` are the faces of the input under the points, `held` (n,) the vertices that are in place already.
    """
    p = mesh.position
    done = 0
    for i in range(len(points)):
        best, distance = -1, np.inf
        taken = False
        for h in range(3 * near[i], 3 * near[i] + 3):
            v = mesh.tail[h]
            d = 0.0
            for axis in range(3):
                d += (p[v, axis] - points[i, axis]) ** 2
            if d < distance:
                best, distance = v, d
                taken = mesh.chain[v] != FREE or held[v]
        if taken or best < 0:
            continue
        if not keeps_shape(best, points[i], mesh) or not may_move(best, -1, points[i], mesh, normals):
            continue
        for axis in range(3):
            p[best, axis] = points[i, axis]
        mesh.source[mesh.half_edge[best] // 3] = below[i]
        held[best] = True
        done += 1
    return done


@kernel
def keeps_shape(v: int, place: Vectors, mesh: EditableMesh) -> bool:
    """Whether no triangle of v gets poor that was not, were v at `place` (3,)."""
    p, tail = mesh.position, mesh.tail
    x, y, z = p[v, 0], p[v, 1], p[v, 2]
    first = mesh.half_edge[v]
    h = first
    good = True
    while good:
        b, c = tail[next_of(h)], tail[prev_of(h)]
        before = shape_of(p, v, b, c)
        p[v, 0], p[v, 1], p[v, 2] = place[0], place[1], place[2]
        good = shape_of(p, v, b, c) >= min(before, _FIT_SHAPE)
        p[v, 0], p[v, 1], p[v, 2] = x, y, z
        h = mesh.twin[prev_of(h)]
        if h < 0 or h == first:
            break
    return good


def flip_nearer(mesh: EditableMesh, source: InputSurface, tolerance: float) -> int:
    """Flip edges whose middle is farther than `tolerance` from the input where that brings it nearer."""
    h = np.flatnonzero((mesh.tail >= 0) & (mesh.twin < np.arange(len(mesh.twin))) & (mesh.twin >= 0))
    h = h[mesh.crease[h] < 0].astype(np.int32)
    g = mesh.twin[h]
    p, tail = mesh.position, mesh.tail
    middle = 0.5 * (p[tail[h]] + p[tail[g]])
    # Few edges are far from the input: most are near the face that they are known to be above.
    doubtful = ~source.are_within(middle, mesh.source[h // 3], tolerance)
    h, g, middle = h[doubtful], g[doubtful], middle[doubtful]
    before = np.linalg.norm(source.closest(middle, mesh.source[h // 3])[1] - middle, axis=1)
    far = before > tolerance
    h, g, before = h[far], g[far], before[far]
    middle = 0.5 * (p[tail[h - h % 3 + (h + 2) % 3]] + p[tail[g - g % 3 + (g + 2) % 3]])
    after = np.linalg.norm(source.closest(middle, mesh.source[h // 3])[1] - middle, axis=1)
    better = np.flatnonzero(after < _CLEARLY_NEARER * before)
    order = better[np.argsort(after[better] - before[better], kind="stable")]
    return int(_flip_apart(h[order], mesh, source.normals))


@kernel
def _flip_apart(candidates: Indices, mesh: EditableMesh, normals: Vectors) -> int:
    """Flip those of the candidates that may be, no two of which share a face; returns how many."""
    touched = np.zeros(mesh.count[1], np.bool_)
    p, tail = mesh.position, mesh.tail
    done = 0
    for i in range(len(candidates)):
        h = candidates[i]
        g = mesh.twin[h]
        if touched[h // 3] or touched[g // 3]:
            continue
        a, b, c, d = tail[h], tail[g], tail[prev_of(h)], tail[prev_of(g)]
        before = min(shape_of(p, a, b, c), shape_of(p, b, a, d))
        after = min(shape_of(p, a, d, c), shape_of(p, d, b, c))
        if after >= min(before, _FIT_SHAPE) and may_flip(h, mesh, normals):
            flip_edge(h, mesh)
            touched[h // 3] = touched[g // 3] = True
            done += 1
    return done
